"""The simulated world on the real wire protocols; nobody in the station imports it."""
