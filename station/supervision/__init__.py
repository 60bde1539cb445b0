"""Process supervision: start, monitoring, restart within a budget, orderly end."""
