"""Alarms raised, cleared and published."""
