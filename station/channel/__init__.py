"""Requests and replies between the station's processes: typed messages, and a deadline on every request."""
