"""Run page."""
