"""Concluded inspections are sealed; what the station itself does to them afterwards is no fault."""

import asyncio
import sqlite3
from dataclasses import replace

from station.channel.line import Reason
from station.messages import records as messages
from station.records.database import FILE_NAME


def test_what_the_station_does_itself_is_no_fault(
    opened, scenario, folder, trigger, passed, failed, noise, settled, ask
):
    """Images make room, an outcome is another one than was judged, a trigger is withdrawn, a start ends what ran."""

    async def steps():
        async with opened(images_quota_mb=1) as records:
            for number in range(4):  # an image is 0.3 MB, so that 3 fit
                record = replace(failed, images=(noise(side_px=320, step=number),))
                await records.published(await records.conclude(await records.begin(trigger), record))
                await settled(records)
            assert (await records.inspection(1)).images_state == messages.IMAGES_REMOVED()
            outcome = await records.conclude(await records.begin(trigger), passed)
            late = outcome.model_copy(update={"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True})
            await records.published(late)
            gone = asyncio.create_task(records.begin(trigger))
            await asyncio.sleep(0)
            gone.cancel()
            await records.begin(trigger)
            said = await asyncio.to_thread(ask, "check")
            assert (said.exit_code, "fault" in said.output) == (0, False), said.output
        async with opened() as records:
            assert len(records.lost) == 1
            await records.acknowledged(7)

    scenario(steps)
    said = ask("check")
    assert said.exit_code == 0, said.output
    assert "note" not in said.output


def test_inspections_of_before_the_seals_are_noted_and_later_ones_sealed(
    opened, scenario, folder, trigger, passed, ask
):
    async def inspect(number):
        async with opened() as records:
            for _ in range(number):
                await records.published(await records.conclude(await records.begin(trigger), passed))

    scenario(lambda: inspect(3))
    connection = sqlite3.connect(folder / FILE_NAME)  # as the version before left it
    connection.execute("PRAGMA foreign_keys = ON")
    for name in ("audit_no_update", "audit_no_delete", "audit_only_after"):
        connection.execute(f"DROP TRIGGER {name}")
    connection.execute("DELETE FROM audit")
    connection.execute("DELETE FROM inspections WHERE sequence = 2")
    connection.execute("DROP INDEX ix_audit_without_seals")
    connection.execute("UPDATE alembic_version SET version_num = '0008'")
    refused = "SELECT RAISE(ABORT, 'the audit trail only grows: its rows are never changed or removed')"
    connection.execute(f"CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN {refused}; END")
    connection.execute(f"CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN {refused}; END")
    connection.execute(
        "CREATE TRIGGER audit_only_after BEFORE INSERT ON audit WHEN NEW.seq <= (SELECT max(seq) FROM audit) "
        f"BEGIN {refused}; END"
    )
    connection.commit()
    connection.close()
    for name in ("audit_head", "signing_key.pem", "public_key.pem"):
        (folder / name).unlink()
    said = ask("check")
    assert said.exit_code == 0, said.output
    assert "note: none of 2 inspections is sealed: they are of an earlier version" in said.output
    scenario(lambda: inspect(1))
    said = ask("check")
    assert said.exit_code == 0, said.output
    assert "note: inspection 2 is missing, of before the seals" in said.output
    assert "note: 2 inspections up to number 3 are of an earlier version, and not sealed" in said.output
    connection = sqlite3.connect(folder / FILE_NAME)
    connection.execute("UPDATE inspections SET area_mm2 = 1 WHERE sequence = 4")
    connection.commit()
    connection.close()
    assert "fault: inspection 4: record changed" in ask("check").output


def test_an_inspection_that_the_station_did_not_make_is_found(opened, scenario, folder, trigger, passed, ask):
    async def steps():
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), passed))

    scenario(steps)
    connection = sqlite3.connect(folder / FILE_NAME)
    columns = [name for (_, name, *_) in connection.execute("PRAGMA table_info(inspections)") if name != "sequence"]
    names = ", ".join(columns)
    connection.execute(f"INSERT INTO inspections (sequence, {names}) SELECT 2, {names} FROM inspections")
    connection.commit()
    connection.close()
    said = ask("check").output
    assert "fault: inspection 2: record not sealed" in said
    assert "fault: inspection 2: outcome not sealed" in said


def test_rows_that_a_killed_station_did_not_sign_are_noted_by_the_next_start(opened, scenario, folder, trigger, ask):
    async def steps(number):
        async with opened() as records:
            for _ in range(number):
                await records.begin(trigger)

    scenario(lambda: steps(1))
    before = (folder / "audit_head").read_bytes()
    scenario(lambda: steps(0))  # ends the inspection that ran, and seals its outcome
    (folder / "audit_head").write_bytes(before)
    said = ask("check")
    assert said.exit_code == 1
    assert "the signed head does not name them" in said.output
    scenario(lambda: steps(0))
    said = ask("check")
    assert said.exit_code == 0, said.output
    assert "without a signed head, as a killed station leaves" in said.output
