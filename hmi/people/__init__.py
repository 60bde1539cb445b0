"""People page: log-in, log-out, users."""
