"""One inspection's cycle: from an accepted trigger to its outcome."""
