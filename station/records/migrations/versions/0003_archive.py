"""Schema: search by lot, grower, time, outcome and reason; held images; the outbox."""

import uuid

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Make the tables, and fill them from the inspections that there are."""
    op.create_table(
        "reasons",
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("outcome", sa.Text(), nullable=False),
        sa.Column("sequence", sa.Integer(), autoincrement=False, nullable=False),
        sa.ForeignKeyConstraint(
            ["sequence"], ["inspections.sequence"], name=op.f("fk_reasons_sequence"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("reason", "outcome", "sequence", name=op.f("pk_reasons")),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "hours",
        sa.Column("first_sequence", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("hour", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("first_sequence", name=op.f("pk_hours")),
    )
    op.create_index("ix_hours_hour", "hours", ["hour"])
    op.create_table(
        "lots",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("grower", sa.Text(), nullable=False),
        sa.Column("began_utc_ms", sa.Integer(), nullable=False),
        sa.Column("ended_utc_ms", sa.Integer(), nullable=True),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_lots")),
        sa.UniqueConstraint("name", name=op.f("uq_lots_name")),
    )
    op.create_index("ix_lots_grower", "lots", ["grower"])
    _holds()
    op.create_table(
        "outbox",
        sa.Column("entry", sa.Integer(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("row", sa.Integer(), nullable=False),
        sa.CheckConstraint("kind IN ('inspection', 'lot', 'audit')", name=op.f("ck_outbox_kind")),
        sa.PrimaryKeyConstraint("entry", name=op.f("pk_outbox")),
        sqlite_autoincrement=True,
    )
    origins = op.create_table(
        "origins",
        sa.Column("first_entry", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("id", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("first_entry", name=op.f("pk_origins")),
    )
    op.bulk_insert(origins, [{"first_entry": 1, "id": uuid.uuid4().hex}])
    op.drop_index("ix_inspections_began_utc_ms", "inspections")
    op.create_index("ix_inspections_lot_outcome", "inspections", ["lot", "outcome"])
    op.create_index("ix_inspections_outcome", "inspections", ["outcome"])
    op.execute(
        "INSERT INTO reasons SELECT DISTINCT json_each.value, outcome, sequence"
        " FROM inspections, json_each(standing, '$.reasons') WHERE standing IS NOT NULL"
    )
    op.execute(
        "INSERT INTO hours SELECT sequence, hour FROM (SELECT sequence, began_utc_ms / 3600000 AS hour,"
        " lag(began_utc_ms / 3600000) OVER (ORDER BY sequence) AS before FROM inspections)"
        " WHERE before IS NULL OR before <> hour"
    )
    op.execute(
        "INSERT INTO outbox (kind, \"row\") SELECT 'inspection', sequence FROM inspections"
        " WHERE published_utc_ms IS NOT NULL ORDER BY sequence"
    )
    op.execute("INSERT INTO outbox (kind, \"row\") SELECT 'audit', seq FROM audit ORDER BY seq")
    op.execute(
        "CREATE TRIGGER audit_told AFTER INSERT ON audit"
        " BEGIN INSERT INTO outbox (kind, \"row\") VALUES ('audit', NEW.seq); END"
    )


def _holds() -> None:
    op.create_table(
        "holds",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("sequence", sa.Integer(), nullable=True),
        sa.Column("lot", sa.Text(), nullable=True),
        sa.Column("reason", sa.Text(), nullable=False),
        sa.Column("by", sa.Text(), nullable=False),
        sa.Column("placed_utc_ms", sa.Integer(), nullable=False),
        sa.Column("released_utc_ms", sa.Integer(), nullable=True),
        sa.Column("released_by", sa.Text(), nullable=True),
        sa.Column("release_reason", sa.Text(), nullable=True),
        sa.CheckConstraint("(sequence IS NULL) <> (lot IS NULL)", name=op.f("ck_holds_one_thing")),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_holds")),
    )
    for column in ("sequence", "lot"):
        op.create_index(
            f"ix_holds_{column}",
            "holds",
            [column],
            unique=True,
            sqlite_where=sa.text(f"released_utc_ms IS NULL AND {column} IS NOT NULL"),
        )
