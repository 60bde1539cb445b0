"""The operators' pages: a process of its own that reaches the station through the channel only."""
