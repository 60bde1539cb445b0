"""History page."""
