"""The robot arm."""
