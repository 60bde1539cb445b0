"""Faults played against the real processes of a station, and what became of the fruit."""
