"""Schema: people's marks of fruit, and who shelved an alarm."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Make the table and the column; nothing that is there changes."""
    op.create_table(
        "marks",
        sa.Column("sequence", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("mark", sa.Text(), nullable=False),
        sa.Column("by", sa.Text(), nullable=False),
        sa.Column("marked_utc_ms", sa.Integer(), nullable=False),
        sa.CheckConstraint("mark IN ('good', 'bad')", name=op.f("ck_marks_mark")),
        sa.ForeignKeyConstraint(
            ["sequence"], ["inspections.sequence"], name=op.f("fk_marks_sequence"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_marks")),
    )
    op.add_column("alarms", sa.Column("shelved_by", sa.Text(), nullable=False, server_default=""))
