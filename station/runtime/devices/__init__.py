"""The cell's devices while the station runs: connected, watched, moved."""
