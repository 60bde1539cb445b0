"""What it costs to look at the operators' pages: who looks, in which rounds, and what follows from the figures."""
