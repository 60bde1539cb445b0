"""Offline experiments: measurement methods on the simulated world; the only package that imports both."""
