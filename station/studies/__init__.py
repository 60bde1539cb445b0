"""Experiments on the twin: the one room where the simulated world and the measurement meet, offline."""
