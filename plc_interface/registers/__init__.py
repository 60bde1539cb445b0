"""Register map: the one table of registers, its encoding, and what is generated from it."""
