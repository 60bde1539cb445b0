"""Maintenance page."""
