"""Schema: search by fruit, the recipe of an inspection."""

from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Make the index; nothing that is there changes."""
    op.create_index("ix_inspections_recipe_sha256", "inspections", ["recipe_sha256"])
