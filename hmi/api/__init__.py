"""HTTP API for a plant's own systems."""
