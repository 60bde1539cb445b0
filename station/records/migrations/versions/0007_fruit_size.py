"""Schema: the fruit's size as the line's PLC gave it with the trigger."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"


def upgrade() -> None:
    """Make the columns; of the inspections that are there no size was given."""
    for name in ("fruit_length_mm_x10", "size_class"):
        op.add_column("inspections", sa.Column(name, sa.Integer(), nullable=False, server_default="0"))
