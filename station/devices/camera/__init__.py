"""The tactile camera: what the station asks of it, and its drivers."""
