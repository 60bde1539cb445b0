"""Soft, textured, hollow and long bodies on the gel: what a real sensor showed beside firm fruit."""
