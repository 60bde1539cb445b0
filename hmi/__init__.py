"""The operator panel, served to a browser."""
