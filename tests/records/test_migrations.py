"""Migrations: a database of any earlier schema version is migrated, with a backup copy; a newer one is not changed."""

import csv
import json
import shutil
import sqlite3
from dataclasses import replace

import pytest
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory

from station.inspection.fruit_size import FruitSize
from station.messages import records as messages
from station.messages.judge import AREA_UNKNOWN, CLOSING, CONTACT_LOST, NO_ONSET
from station.messages.message import Message, joined, verbatim
from station.outbox.feed import read_batch
from station.records import migration
from station.records.database import FILE_NAME, open_engine
from station.records.errors import SchemaError
from station.records.migration import MIGRATIONS, migrate
from station.records.schema import metadata
from station.records.stored_message import from_stored
from tests.records.causes import because
from tests.stored_inspection import read_record

NEXT = """
from alembic import op
import sqlalchemy as sa
revision = "9999"
down_revision = "{head}"
def upgrade():
    with op.batch_alter_table("inspections") as table:
        table.add_column(sa.Column("grower", sa.Text()))
    {then}
"""


@pytest.fixture
def head():
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    return ScriptDirectory.from_config(config).get_current_head()


@pytest.fixture
def next_form(tmp_path, monkeypatch, head):
    """Let the program be one whose form is 9999."""

    def use(then="pass"):
        folder = tmp_path / "migrations"
        shutil.copytree(MIGRATIONS, folder, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
        (folder / "versions" / "9999_next.py").write_text(NEXT.format(then=then, head=head))
        monkeypatch.setattr(migration, "MIGRATIONS", folder)

    return use


def query(path, text):
    connection = sqlite3.connect(path)
    try:
        return connection.execute(text).fetchall()
    finally:
        connection.close()


def test_migrations_from_nothing_lead_to_the_tables_of_the_program(tmp_path):
    engine = open_engine(tmp_path / FILE_NAME, "rwc")
    migrate(engine, tmp_path)
    migrate(engine, tmp_path)  # there is nothing more to do
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True, "target_metadata": metadata})
        assert compare_metadata(context, metadata) == []
        made = {row[0] for row in connection.exec_driver_sql("SELECT sql FROM sqlite_master WHERE sql LIKE '%CHECK%'")}
    assert sum(text.count("CHECK") for text in made) == 10
    engine.dispose()


def test_an_earlier_form_is_brought_up_to_date_with_a_copy_kept(opened, scenario, folder, trigger, next_form, head):
    async def steps():
        async with opened() as records:
            await records.begin(trigger)
        lineage = read_batch(folder, "s", 0).lineage
        next_form()
        (folder / "backups").mkdir()
        (folder / "backups" / f"20260101T000000Z-form-{head}.partial").write_text("of a start that was killed")
        async with opened() as records:
            assert records.lost == (1,)
            assert await records.begin(trigger) == 2
        (backup,) = (folder / "backups").iterdir()
        assert backup.name.endswith(f"-form-{head}.sqlite3")
        assert query(backup, "SELECT sequence, outcome FROM inspections") == [(1, None)]
        assert query(folder / FILE_NAME, "SELECT grower FROM inspections") == [(None,), (None,)]
        assert read_batch(folder, "s", 0).lineage == lineage

    scenario(steps)


def test_records_from_before_the_second_witness_read_without_it(opened, scenario, folder, trigger, passed, run_records):
    with_witness = tuple(
        replace(point, changed_area_mm2=9.5 * point.step, changed_area_px=13_000 * point.step) for point in passed.curve
    )

    async def steps():
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), passed))
        connection = sqlite3.connect(folder / FILE_NAME)
        for column in ("changed_area_mm2", "changed_area_px"):
            connection.execute(f"ALTER TABLE curve_points DROP COLUMN {column}")
        for column in ("fruit_length_mm_x10", "size_class"):
            connection.execute(f"ALTER TABLE inspections DROP COLUMN {column}")
        connection.execute("DROP INDEX ix_audit_without_seals")
        connection.execute("UPDATE alembic_version SET version_num = '0005'")
        connection.commit()
        connection.close()
        async with opened() as records:
            await records.published(
                await records.conclude(await records.begin(trigger), replace(passed, curve=with_witness))
            )
            return [read_record(records, sequence).judged.curve for sequence in (1, 2)]

    old, new = scenario(steps)
    assert old == passed.curve
    assert {(point.changed_area_mm2, point.changed_area_px) for point in old} == {(None, None)}
    assert new == with_witness
    (backup,) = (folder / "backups").iterdir()
    assert backup.name.endswith("-form-0005.sqlite3")
    assert "changed mm²" in run_records("show", 1).output
    last = run_records("show", 2).output.split("changed mm²")[1].splitlines()[5].split()
    assert last == ["4", "26.00", "4.00", "32.0", "44000", "38.0", "52000", "0.90", "-"]
    run_records("export", folder / "all.csv")
    with (folder / "all.csv").open(newline="", encoding="utf-8") as file:
        exported = [json.loads(row["changed_areas_mm2"]) for row in csv.DictReader(file)]
    assert exported == [[None] * 5, [0.0, 9.5, 19.0, 28.5, 38.0]]


def test_records_from_before_the_fruits_size_read_without_it(opened, scenario, folder, trigger, passed, run_records):
    sized = replace(trigger, fruit_length_mm_x10=483, size_class=3)

    async def steps():
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), passed))
        connection = sqlite3.connect(folder / FILE_NAME)
        for column in ("fruit_length_mm_x10", "size_class"):
            connection.execute(f"ALTER TABLE inspections DROP COLUMN {column}")
        connection.execute(
            "UPDATE inspections SET standing = json_remove(standing, '$.fruit_length_mm_x10', '$.size_class')"
        )
        connection.execute("DROP INDEX ix_audit_without_seals")
        connection.execute("UPDATE alembic_version SET version_num = '0006'")
        connection.commit()
        connection.close()
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(sized), passed))
            return [read_record(records, sequence) for sequence in (1, 2)]

    old, new = scenario(steps)
    assert (old.trigger, old.trigger.size) == (trigger, FruitSize())
    assert (new.trigger, new.trigger.size) == (sized, FruitSize(48.3, 3))
    assert [(one.standing.fruit_length_mm_x10, one.standing.size_class) for one in (old, new)] == [(0, 0), (483, 3)]
    assert "size:         not given by the PLC\n" in run_records("show", 1).output
    assert "size:         fruit length 48.3 mm, class 3 (given by the PLC)\n" in run_records("show", 2).output
    run_records("export", folder / "all.csv")
    with (folder / "all.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    added = ["fruit_length_mm", "size_class", "recipe_revision", "fruit_width_mm"]
    assert list(rows[0])[-4:] == added, "columns are added at the end"
    assert [(row["fruit_length_mm"], row["size_class"]) for row in rows] == [("", ""), ("48.3", "3")]


def test_records_from_before_messages_read_with_their_sentences(opened, scenario, folder, trigger, failed, run_records):
    area = (
        "The area at 4 mm of closing is at least 170.0 mm²; the limit for a strawberry of 40 mm is 165 mm²: it is over."
    )
    judgement, first = "The area at 4 mm of closing is 170.0 ± 7.2 mm².", "At 4.0 mm of closing the contact was lost."
    now = replace(
        failed,
        judgement=AREA_UNKNOWN(closing_mm=4.0),
        first_press_findings=joined([CONTACT_LOST(closings=[CLOSING(closing_mm=3.0)]), NO_ONSET()]),
    )

    async def steps():
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), failed))
        connection = sqlite3.connect(folder / FILE_NAME)
        connection.execute(
            "UPDATE inspections SET explanation = ?, measures = json_set(measures, '$.judgement', ?, "
            "'$.first_press_findings', ?)",
            (json.dumps([area]), judgement, first),
        )
        connection.execute("DROP INDEX ix_audit_without_seals")
        connection.execute("UPDATE alembic_version SET version_num = '0007'")
        connection.commit()
        connection.close()
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), now))
            return [read_record(records, sequence).judged for sequence in (1, 2)]

    old, new = scenario(steps)
    assert (old.explanation, old.judgement) == ((verbatim(area),), verbatim(judgement))
    assert (old.first_press_findings, old.measures) == (verbatim(first), failed.measures)
    assert (new.explanation, new.judgement, new.first_press_findings, new.measures) == (
        now.explanation, now.judgement, now.first_press_findings, now.measures
    )  # fmt: skip
    for sequence, each in ((1, old), (2, new)):
        output = run_records("show", sequence).output
        for message in (*each.explanation, each.judgement, each.first_press_findings):
            assert str(message) in output
        assert "judge." not in output
    batch = read_batch(folder, "one", 0).events
    events = {event.data["sequence"]: event.data for event in batch if event.kind == "inspection"}
    assert events[1]["explanation"] == [area]
    assert events[1]["messages"] == [{"id": "text.verbatim", "parameters": {"text": area}}]
    assert events[1]["measures"]["judgement"] == judgement
    assert events[2]["explanation"] == [str(message) for message in now.explanation]
    assert [Message.model_validate_json(json.dumps(each)) for each in events[2]["messages"]] == list(now.explanation)
    assert events[2]["measures"]["first_press_findings"] == str(now.first_press_findings)


def test_what_is_stored_and_is_no_message_is_shown_as_it_is():
    assert from_stored({"id": "judge.late", "parameters": {"late": True}}) == verbatim(
        '{"id": "judge.late", "parameters": {"late": true}}'
    )


def test_a_failed_migration_leaves_the_database_as_it_was(opened, scenario, folder, trigger, next_form, head):
    async def steps():
        async with opened() as records:
            await records.begin(trigger)
        next_form('op.execute("INSERT INTO nowhere VALUES (1)")')
        with pytest.raises(SchemaError, match=f"form-{head}", check=because(messages.NOT_MIGRATED)):
            async with opened():
                pass
        assert query(folder / FILE_NAME, "SELECT version_num FROM alembic_version") == [(head,)]
        with pytest.raises(sqlite3.OperationalError, match="no such column"):
            query(folder / FILE_NAME, "SELECT grower FROM inspections")

    scenario(steps)


def test_a_newer_form_is_left_alone(opened, scenario, folder, trigger, next_form, monkeypatch):
    async def steps():
        async with opened() as records:
            await records.begin(trigger)
        with monkeypatch.context():
            next_form()
            async with opened():
                pass
        monkeypatch.setattr(migration, "MIGRATIONS", MIGRATIONS)
        before = (folder / FILE_NAME).read_bytes()
        with pytest.raises(SchemaError, match="9999", check=because(messages.NEWER_SCHEMA)):
            async with opened():
                pass
        assert (folder / FILE_NAME).read_bytes() == before
        assert not (folder / "aside").exists()

    scenario(steps)
