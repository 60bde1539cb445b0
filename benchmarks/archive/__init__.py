"""Fixtures of the archive's benchmarks and tests: many inspections written quickly, and a throwaway PostgreSQL."""
