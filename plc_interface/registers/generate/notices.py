"""Sentences common to all generated files."""

MADE_BY = "Made by `station plc docs` from the register map: do not edit, run it again."
UNTESTED = "Untested against the vendor's tool."
