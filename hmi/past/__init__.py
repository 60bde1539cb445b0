"""History in the records, read without the station."""
