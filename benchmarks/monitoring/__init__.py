"""A real Prometheus, a demonstration that it scrapes, a month that never was, and what is asked of them."""
