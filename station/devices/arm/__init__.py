"""Robot arm: its Protocol and its driver."""
