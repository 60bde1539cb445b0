"""The simulated world on the real wire protocols; in the station only the studies import it."""
