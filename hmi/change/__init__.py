"""Change fruit page."""
