"""The pages and the HTTP API against a station on the twin's bench."""
