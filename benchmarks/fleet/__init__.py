"""A fleet of stations: whole ones that run at the same time, a year of their records and metrics, and a study's cluster."""
