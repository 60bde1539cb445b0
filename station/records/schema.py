"""Tables of the database. A change here needs a migration: a test compares the two.

Times are UTC in ms as the machine's clock gave them, which may step; what is ordered is ordered by sequence or row.
"""

from sqlalchemy import (
    JSON,
    Boolean,
    CheckConstraint,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    Table,
    Text,
    text,
)

metadata = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "ck": "ck_%(table_name)s_%(constraint_name)s",
        "fk": "fk_%(table_name)s_%(column_0_name)s",
        "pk": "pk_%(table_name)s",
    }
)

recipe_snapshots = Table(
    "recipe_snapshots",
    metadata,
    Column("sha256", Text, primary_key=True),
    Column("name", Text, nullable=False),
    Column("number", Integer, nullable=False),
    Column("revision", Text, nullable=False),
    Column("checksum", Integer, nullable=False),
    Column("text", Text, nullable=False),
)

inspections = Table(
    "inspections",
    metadata,
    Column("sequence", Integer, primary_key=True, autoincrement=False),
    Column("boot", Text, nullable=False),
    Column("trigger_id", Integer, nullable=False),
    Column("encoder", Integer, nullable=False),
    Column("lot", Text, nullable=False),
    Column("recipe_sha256", Text, ForeignKey("recipe_snapshots.sha256")),
    Column("recipe_number", Integer, nullable=False),
    Column("recipe_checksum", Integer, nullable=False),
    Column("simulated", Boolean, nullable=False),
    Column("began_utc_ms", Integer, nullable=False),
    Column("ended_utc_ms", Integer),
    Column("duration_ms", Integer),
    Column("judged", Text),
    Column("reasons", JSON(none_as_null=True)),
    Column("explanation", JSON(none_as_null=True)),
    Column("late", Boolean),
    Column("partial", Boolean),
    Column("area_mm2", Float),
    Column("area_px", Integer),
    Column("closing_mm", Float),
    Column("confidence", Float),
    Column("phases_s", JSON(none_as_null=True)),
    Column("measures", JSON(none_as_null=True)),
    Column("devices", JSON(none_as_null=True)),
    Column("versions", JSON(none_as_null=True)),
    Column("images_state", Text, nullable=False),
    Column("outcome", Text),
    Column("standing", Text),
    Column("published_utc_ms", Integer),
    Column("acknowledged_utc_ms", Integer),
    Column("fruit_length_mm_x10", Integer, nullable=False, server_default="0"),
    Column("size_class", Integer, nullable=False, server_default="0"),
    CheckConstraint("judged IN ('PASS', 'FAIL', 'NO_RESULT')", name="judged"),
    CheckConstraint("outcome IN ('PASS', 'FAIL', 'NO_RESULT')", name="outcome"),
    CheckConstraint("published_utc_ms IS NULL OR outcome IS NOT NULL", name="published"),
    CheckConstraint("acknowledged_utc_ms IS NULL OR published_utc_ms IS NOT NULL", name="acknowledged"),
)
"""`judged` and its columns are the station's own result; `outcome` and `standing` are published to the PLC, or will be:
the name, and the whole message."""
Index("ix_inspections_unacknowledged", inspections.c.sequence, sqlite_where=inspections.c.acknowledged_utc_ms.is_(None))
Index("ix_inspections_lot", inspections.c.lot)
Index("ix_inspections_lot_outcome", inspections.c.lot, inspections.c.outcome)
Index("ix_inspections_outcome", inspections.c.outcome)
Index("ix_inspections_recipe_sha256", inspections.c.recipe_sha256)

reasons = Table(
    "reasons",
    metadata,
    Column("reason", Text, primary_key=True),
    Column("outcome", Text, primary_key=True),
    Column("sequence", ForeignKey("inspections.sequence", ondelete="CASCADE"), primary_key=True, autoincrement=False),
    sqlite_with_rowid=False,
)
"""Every reason of the outcome in force, for searches; the order is in `standing`."""

hours = Table(
    "hours",
    metadata,
    Column("first_sequence", Integer, primary_key=True, autoincrement=False),
    Column("hour", Integer, nullable=False),
    Index("ix_hours_hour", "hour"),
)
"""Changes of the UTC hour of the begin (ms // 3,600,000) from one number to the next: a span goes on to the number
before the next row's. So a time is found by number also where the clock stepped."""

lots = Table(
    "lots",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("name", Text, nullable=False, unique=True),
    Column("grower", Text, nullable=False),
    Column("began_utc_ms", Integer, nullable=False),
    Column("ended_utc_ms", Integer),
    Column("revision", Integer, nullable=False),
    Index("ix_lots_grower", "grower"),
)
"""Lots as people or the packhouse's system register them; the PLC gives only the name, which is in `inspections`."""

holds = Table(
    "holds",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("sequence", Integer),
    Column("lot", Text),
    Column("reason", Text, nullable=False),
    Column("by", Text, nullable=False),
    Column("placed_utc_ms", Integer, nullable=False),
    Column("released_utc_ms", Integer),
    Column("released_by", Text),
    Column("release_reason", Text),
    CheckConstraint("(sequence IS NULL) <> (lot IS NULL)", name="one_thing"),
)
"""Images that must not be removed, of an inspection or of a whole lot, until they are released."""
Index(
    "ix_holds_sequence",
    holds.c.sequence,
    unique=True,
    sqlite_where=holds.c.released_utc_ms.is_(None) & holds.c.sequence.is_not(None),
)
Index(
    "ix_holds_lot", holds.c.lot, unique=True, sqlite_where=holds.c.released_utc_ms.is_(None) & holds.c.lot.is_not(None)
)

marks = Table(
    "marks",
    metadata,
    Column("sequence", ForeignKey("inspections.sequence", ondelete="CASCADE"), primary_key=True, autoincrement=False),
    Column("mark", Text, nullable=False),
    Column("by", Text, nullable=False),
    Column("marked_utc_ms", Integer, nullable=False),
    CheckConstraint("mark IN ('good', 'bad')", name="mark"),
)
"""A fruit's true quality as a person found it, to propose thresholds from; the audit trail has earlier marks."""

outbox = Table(
    "outbox",
    metadata,
    Column("entry", Integer, primary_key=True),
    Column("kind", Text, nullable=False),
    Column("row", Integer, nullable=False),
    CheckConstraint("kind IN ('inspection', 'lot', 'audit')", name="kind"),
    sqlite_autoincrement=True,
)
"""Events for other systems, in order: a published inspection, a lot's row or the audit trail's. Never removed: some 15
bytes each, and a new destination begins with the first."""

origins = Table(
    "origins",
    metadata,
    Column("first_entry", Integer, primary_key=True, autoincrement=False),
    Column("id", Text, nullable=False),
)
"""The database that numbered the entries from `first_entry` on: a new one after each restore, also where a
copy was put back by hand, so that a number given again is not taken for the one given before."""

curve_points = Table(
    "curve_points",
    metadata,
    Column("sequence", ForeignKey("inspections.sequence", ondelete="CASCADE"), primary_key=True),
    Column("step", Integer, primary_key=True, autoincrement=False),
    Column("width_mm", Float, nullable=False),
    Column("closing_mm", Float),
    Column("area_mm2", Float),
    Column("area_px", Integer),
    Column("confidence", Float),
    Column("flags", JSON, nullable=False),
    Column("captured_s", Float),
    Column("changed_area_mm2", Float),
    Column("changed_area_px", Integer),
)

images = Table(
    "images",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("sequence", ForeignKey("inspections.sequence", ondelete="CASCADE"), nullable=False),
    Column("kind", Text, nullable=False),
    Column("step", Integer),
    Column("sha256", Text, nullable=False),
    Column("size_bytes", Integer, nullable=False),
    CheckConstraint("kind IN ('reference', 'step', 'mask')", name="kind"),
    Index("ix_images_sequence", "sequence"),
    Index("ix_images_sha256", "sha256"),
)
"""The file is `images/<first two of sha256>/<sha256>.png` beside the database."""

alarms = Table(
    "alarms",
    metadata,
    Column("id", Text, primary_key=True),
    Column("state", Text, nullable=False),
    Column("raised_utc_ms", Integer, nullable=False),
    Column("changed_utc_ms", Integer, nullable=False),
    Column("detail", Text, nullable=False),
    Column("shelved_until_utc_ms", Integer),
    Column("shelved_by", Text, nullable=False, server_default=""),
)
"""Alarms that are not in their normal state."""

alarms_log = Table(
    "alarms_log",
    metadata,
    Column("row", Integer, primary_key=True),
    Column("utc_ms", Integer, nullable=False),
    Column("id", Text, nullable=False),
    Column("change", Text, nullable=False),
    Column("detail", Text, nullable=False),
    Column("sequence", Integer),
)

counters = Table(
    "counters",
    metadata,
    Column("name", Text, primary_key=True),
    Column("value", Integer, nullable=False),
)
"""Of earlier schemas; nothing writes it."""

events = Table(
    "events",
    metadata,
    Column("row", Integer, primary_key=True),
    Column("utc_ms", Integer, nullable=False),
    Column("name", Text, nullable=False),
    Column("sequence", Integer),
    Column("details", JSON, nullable=False),
)

audit = Table(
    "audit",
    metadata,
    Column("seq", Integer, primary_key=True, autoincrement=False),
    Column("utc_ms", Integer, nullable=False),
    Column("who", Text, nullable=False),
    Column("role", Text, nullable=False),
    Column("action", Text, nullable=False),
    Column("subject", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("old", Text),
    Column("new", Text),
    Column("previous_hash", Text, nullable=False),
    Column("hash", Text, nullable=False),
    Index("ix_audit_action", "action", "seq"),
    Index("ix_audit_without_seals", "seq", sqlite_where=text("action <> 'inspection.sealed'")),
)
"""Triggers refuse every change but an insert behind the last row. `old` and `new` are canonical JSON, as hashed."""

recipe_revisions = Table(
    "recipe_revisions",
    metadata,
    Column("name", Text, primary_key=True),
    Column("revision", Integer, primary_key=True, autoincrement=False),
    Column("number", Integer, nullable=False),
    Column("sha256", Text, nullable=False),
    Column("text", Text, nullable=False),
    Column("status", Text, nullable=False),
    Column("origin", Text, nullable=False),
    Column("based_on", Integer),
    Column("author", Text, nullable=False),
    Column("reason", Text, nullable=False),
    Column("created_utc_ms", Integer, nullable=False),
    Column("approver", Text),
    Column("approval_reason", Text),
    Column("approved_utc_ms", Integer),
    Column("retired_by", Text),
    Column("retired_reason", Text),
    Column("retired_utc_ms", Integer),
    CheckConstraint("status IN ('draft', 'approved', 'retired')", name="status"),
    CheckConstraint("approver IS NULL OR approver <> author", name="approver"),
)
"""`text` is the YAML file as it was, `sha256` that of its values, as a snapshot has it."""
Index(
    "ix_recipe_revisions_approved",
    recipe_revisions.c.name,
    unique=True,
    sqlite_where=recipe_revisions.c.status == "approved",
)
