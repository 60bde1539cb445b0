"""First schema of the records."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Make every table."""
    op.create_table(
        "alarms",
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("state", sa.Text(), nullable=False),
        sa.Column("raised_utc_ms", sa.Integer(), nullable=False),
        sa.Column("changed_utc_ms", sa.Integer(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("shelved_until_utc_ms", sa.Integer(), nullable=True),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_alarms")),
    )
    op.create_table(
        "alarms_log",
        sa.Column("row", sa.Integer(), nullable=False),
        sa.Column("utc_ms", sa.Integer(), nullable=False),
        sa.Column("id", sa.Text(), nullable=False),
        sa.Column("change", sa.Text(), nullable=False),
        sa.Column("detail", sa.Text(), nullable=False),
        sa.Column("sequence", sa.Integer(), nullable=True),
        sa.PrimaryKeyConstraint("row", name=op.f("pk_alarms_log")),
    )
    op.create_table(
        "counters",
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("value", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("name", name=op.f("pk_counters")),
    )
    op.create_table(
        "events",
        sa.Column("row", sa.Integer(), nullable=False),
        sa.Column("utc_ms", sa.Integer(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("sequence", sa.Integer(), nullable=True),
        sa.Column("details", sa.JSON(), nullable=False),
        sa.PrimaryKeyConstraint("row", name=op.f("pk_events")),
    )
    op.create_table(
        "recipe_snapshots",
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("revision", sa.Text(), nullable=False),
        sa.Column("checksum", sa.Integer(), nullable=False),
        sa.Column("text", sa.Text(), nullable=False),
        sa.PrimaryKeyConstraint("sha256", name=op.f("pk_recipe_snapshots")),
    )
    op.create_table(
        "inspections",
        sa.Column("sequence", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("boot", sa.Text(), nullable=False),
        sa.Column("trigger_id", sa.Integer(), nullable=False),
        sa.Column("encoder", sa.Integer(), nullable=False),
        sa.Column("lot", sa.Text(), nullable=False),
        sa.Column("recipe_sha256", sa.Text(), nullable=True),
        sa.Column("recipe_number", sa.Integer(), nullable=False),
        sa.Column("recipe_checksum", sa.Integer(), nullable=False),
        sa.Column("simulated", sa.Boolean(), nullable=False),
        sa.Column("began_utc_ms", sa.Integer(), nullable=False),
        sa.Column("ended_utc_ms", sa.Integer(), nullable=True),
        sa.Column("duration_ms", sa.Integer(), nullable=True),
        sa.Column("judged", sa.Text(), nullable=True),
        sa.Column("reasons", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("explanation", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("late", sa.Boolean(), nullable=True),
        sa.Column("partial", sa.Boolean(), nullable=True),
        sa.Column("area_mm2", sa.Float(), nullable=True),
        sa.Column("area_px", sa.Integer(), nullable=True),
        sa.Column("closing_mm", sa.Float(), nullable=True),
        sa.Column("confidence", sa.Float(), nullable=True),
        sa.Column("phases_s", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("measures", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("devices", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("versions", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("images_state", sa.Text(), nullable=False),
        sa.Column("outcome", sa.Text(), nullable=True),
        sa.Column("standing", sa.Text(), nullable=True),
        sa.Column("published_utc_ms", sa.Integer(), nullable=True),
        sa.Column("acknowledged_utc_ms", sa.Integer(), nullable=True),
        sa.CheckConstraint("judged IN ('PASS', 'FAIL', 'NO_RESULT')", name=op.f("ck_inspections_judged")),
        sa.CheckConstraint("outcome IN ('PASS', 'FAIL', 'NO_RESULT')", name=op.f("ck_inspections_outcome")),
        sa.CheckConstraint(
            "acknowledged_utc_ms IS NULL OR published_utc_ms IS NOT NULL", name=op.f("ck_inspections_acknowledged")
        ),
        sa.CheckConstraint("published_utc_ms IS NULL OR outcome IS NOT NULL", name=op.f("ck_inspections_published")),
        sa.ForeignKeyConstraint(
            ["recipe_sha256"], ["recipe_snapshots.sha256"], name=op.f("fk_inspections_recipe_sha256")
        ),
        sa.PrimaryKeyConstraint("sequence", name=op.f("pk_inspections")),
    )
    op.create_index("ix_inspections_began_utc_ms", "inspections", ["began_utc_ms"], unique=False)
    op.create_index("ix_inspections_lot", "inspections", ["lot"], unique=False)
    op.create_index(
        "ix_inspections_unacknowledged",
        "inspections",
        ["sequence"],
        unique=False,
        sqlite_where=sa.text("acknowledged_utc_ms IS NULL"),
    )
    op.create_table(
        "curve_points",
        sa.Column("sequence", sa.Integer(), nullable=False),
        sa.Column("step", sa.Integer(), autoincrement=False, nullable=False),
        sa.Column("width_mm", sa.Float(), nullable=False),
        sa.Column("closing_mm", sa.Float(), nullable=True),
        sa.Column("area_mm2", sa.Float(), nullable=True),
        sa.Column("area_px", sa.Integer(), nullable=True),
        sa.Column("confidence", sa.Float(), nullable=True),
        sa.Column("flags", sa.JSON(), nullable=False),
        sa.Column("captured_s", sa.Float(), nullable=True),
        sa.ForeignKeyConstraint(
            ["sequence"], ["inspections.sequence"], name=op.f("fk_curve_points_sequence"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("sequence", "step", name=op.f("pk_curve_points")),
    )
    op.create_table(
        "images",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("sequence", sa.Integer(), nullable=False),
        sa.Column("kind", sa.Text(), nullable=False),
        sa.Column("step", sa.Integer(), nullable=True),
        sa.Column("sha256", sa.Text(), nullable=False),
        sa.Column("size_bytes", sa.Integer(), nullable=False),
        sa.CheckConstraint("kind IN ('reference', 'step', 'mask')", name=op.f("ck_images_kind")),
        sa.ForeignKeyConstraint(
            ["sequence"], ["inspections.sequence"], name=op.f("fk_images_sequence"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_images")),
    )
    op.create_index("ix_images_sequence", "images", ["sequence"], unique=False)
    op.create_index("ix_images_sha256", "images", ["sha256"], unique=False)
