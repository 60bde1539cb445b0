"""The soak: a whole station for an hour or more, and what grows in it."""
