"""How a database of an earlier program becomes one of this program; run by Alembic when the records are opened."""
