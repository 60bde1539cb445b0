"""A real Prometheus, a demonstration that it scrapes, a month that never was, and the queries to them."""
