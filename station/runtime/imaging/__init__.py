"""Reference and measurement of the frames while the station runs."""
