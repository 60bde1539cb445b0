"""What the benchmarks and tests of the archive share: many inspections quickly, and a PostgreSQL to throw away."""
