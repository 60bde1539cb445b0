"""Job pages."""
