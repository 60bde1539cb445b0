"""Tactile camera: its Protocol and its drivers."""
