"""Alarms page."""
