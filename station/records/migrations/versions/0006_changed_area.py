"""Schema: the changed area of each step's image, beside its contact area."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Make the columns; the steps that are there have none of it."""
    op.add_column("curve_points", sa.Column("changed_area_mm2", sa.Float(), nullable=True))
    op.add_column("curve_points", sa.Column("changed_area_px", sa.Integer(), nullable=True))
