"""A fleet of stations: whole ones at the same time, a year of their records and metrics, a study's cluster."""
