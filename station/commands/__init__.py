"""Command line adapters: each passes its arguments to a package and prints the results."""
