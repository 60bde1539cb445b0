"""Mutation testing of the pure rooms: what a small change of their code breaks in their own tests."""
