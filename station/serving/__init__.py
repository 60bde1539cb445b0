"""Serving of HTTP: our servers of one application, and the guard of their connections."""
