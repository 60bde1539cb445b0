"""Schema: seals of inspections in the audit trail, and an index of the trail's other rows."""

from alembic import op
from sqlalchemy import text

revision = "0009"
down_revision = "0008"


def upgrade() -> None:
    """Make the index. Earlier inspections stay without seals; the first start appends the row that says so."""
    op.create_index("ix_audit_without_seals", "audit", ["seq"], sqlite_where=text("action <> 'inspection.sealed'"))
