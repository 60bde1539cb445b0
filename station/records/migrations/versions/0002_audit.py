"""Schema: the audit trail, to which rows can only be appended, and the recipes' revisions."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"

_REFUSED = "SELECT RAISE(ABORT, 'the audit trail only grows: its rows are never changed or removed')"


def upgrade() -> None:
    """Make both tables, and the triggers that guard the trail."""
    op.create_table(
        "audit",
        sa.Column("seq", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("utc_ms", sa.Integer(), nullable=False),
        sa.Column("who", sa.Text(), nullable=False),
        sa.Column("role", sa.Text(), nullable=False),
        sa.Column("action", sa.Text(), nullable=False),
        sa.Column("subject", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("old", sa.Text(), nullable=True),
        sa.Column("new", sa.Text(), nullable=True),
        sa.Column("previous_hash", sa.Text(), nullable=False),
        sa.Column("hash", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("seq", name=op.f("pk_audit")),
    )
    op.create_index("ix_audit_action", "audit", ["action", "seq"], unique=False)
    op.execute(f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN {_REFUSED}; END")
    op.execute(f"CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN {_REFUSED}; END")
    # An INSERT OR REPLACE removes the old row without running the trigger above.
    behind = "WHEN NEW.seq <= (SELECT max(seq) FROM audit)"
    op.execute(f"CREATE TRIGGER audit_only_after BEFORE INSERT ON audit {behind} BEGIN {_REFUSED}; END")
    op.create_table(
        "recipe_revisions",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("revision", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.Column("status", sa.Text(), nullable=False),
        sa.Column("origin", sa.Text(), nullable=False),
        sa.Column("based_on", sa.Integer(), nullable=True),
        sa.Column("author", sa.Text(), nullable=False),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("created_utc_ms", sa.Integer(), nullable=False),
        sa.Column("approver", sa.Text(), nullable=True),
        sa.Column("approval_reason", sa.Text(), nullable=True),
        sa.Column("approved_utc_ms", sa.Integer(), nullable=True),
        sa.Column("retired_by", sa.Text(), nullable=True),
        sa.Column("retired_reason", sa.Text(), nullable=True),
        sa.Column("retired_utc_ms", sa.Integer(), nullable=True),
        sa.CheckConstraint("status IN ('draft', 'approved', 'retired')", name=op.f("ck_recipe_revisions_status")),
        sa.CheckConstraint("approver IS NULL OR approver <> author", name=op.f("ck_recipe_revisions_approver")),
        sa.PrimaryKeyConstraint("name", "revision", name=op.f("pk_recipe_revisions")),
    )
    op.create_index(
        "ix_recipe_revisions_approved",
        "recipe_revisions",
        ["name"],
        unique=True,
        sqlite_where=sa.text("status = 'approved'"),
    )
