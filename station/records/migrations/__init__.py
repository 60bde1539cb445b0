"""Schema migrations of the database, run by Alembic when the records are opened."""
