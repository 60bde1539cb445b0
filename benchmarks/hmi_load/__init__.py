"""Cost of viewing the operators' pages: the clients, the rounds, and the results drawn from the figures."""
