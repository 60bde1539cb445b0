"""Sorting sound from damaged fruit of the twin, by the station's own procedure and judge."""
