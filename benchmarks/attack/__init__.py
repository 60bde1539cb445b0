"""Attacks on a running station from its networks, and what clients and processes notice of them."""
