"""Sensor calibration with a ball of known size, and its verification at each shift."""
