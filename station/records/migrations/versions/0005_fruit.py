"""Found by fruit: which recipe an inspection was made by."""

from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Make the index; nothing that is there changes."""
    op.create_index("ix_inspections_recipe_sha256", "inspections", ["recipe_sha256"])
