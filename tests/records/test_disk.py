"""Disk faults: full, read-only, locked, damaged, missing; each is reported, and overcome where that is safe."""

import asyncio
import contextlib
import errno
import os
import random
import resource
import sqlite3
import subprocess
import threading
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from sqlalchemy import event

from station.cli import cli
from station.messages import records as messages
from station.messages.message import verbatim
from station.records.audit import AuditEntry, append_audit
from station.records.database import FILE_NAME, open_engine
from station.records.direct_transaction import direct_transaction
from station.records.errors import (
    DamagedError,
    DiskFullError,
    LockedError,
    ReadOnlyError,
    RecordsDeadlineError,
    RecordsError,
    SequenceError,
    UnknownInspectionError,
)
from station.records.high_water_mark import MARK_NAME, HighWaterMark
from station.records.model import RecipeSnapshot, Trigger
from station.records.records import Records
from station.records.short_transaction import short_transaction
from tests.records.causes import because
from tests.stored_inspection import read_record

NOBODY = 65_534
"""The user without rights, by convention of the kernel (/proc/sys/kernel/overflowuid)."""


def bulky(trigger: Trigger, size_bytes: int) -> Trigger:
    """A trigger that takes so much space."""
    return replace(trigger, recipe=RecipeSnapshot("bulky", 1, "", random.Random().randbytes(size_bytes // 2).hex()))


async def begin_many(records: Records, triggers: Iterable[Trigger]) -> None:
    for trigger in triggers:
        await records.begin(trigger)
        await records.open_inspections()


def fill(path: Path) -> None:
    """Take all the space that is left."""
    with contextlib.suppress(OSError), path.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def test_a_full_disk_refuses_and_takes_again_when_there_is_space(opened, scenario, trigger, passed, small_disk):
    async def steps():
        async with opened(small_disk) as records:
            sequence = await records.begin(trigger)
            filler = small_disk / "filler"
            fill(filler)
            with pytest.raises(DiskFullError, check=because(messages.RESERVE_REACHED)):
                await records.begin(trigger)
            large = replace(passed, explanation=(verbatim("x" * 8_000_000),))
            with pytest.raises(DiskFullError, check=because(messages.DISK_FULL)):
                await records.conclude(sequence, large)
            assert records.status().failures["disk_full"] == 2
            assert records.status().error.parameters["cause"].id == messages.DISK_FULL.id
            filler.unlink()
            assert (await records.conclude(sequence, passed)).outcome == "PASS"
            assert await records.begin(trigger) > sequence
            assert records.status().error is None

    scenario(steps)


def test_a_full_database_is_a_full_disk(opened, scenario, trigger, monkeypatch):
    """SQLite's own SQLITE_FULL, without a disk of the test's."""
    monkeypatch.setattr("station.records.open.open_engine", _limited)

    async def steps():
        async with opened() as records:
            with pytest.raises(DiskFullError):
                await begin_many(records, (bulky(trigger, 100_000) for _ in range(100)))
            assert await records.begin(replace(trigger, recipe=None)) > 1, "a small one still fits"

    scenario(steps)


def _limited(path, mode):
    engine = open_engine(path, mode)
    event.listen(engine, "connect", lambda connection, _: connection.execute("PRAGMA max_page_count = 120"))
    return engine


def test_a_file_size_limit_is_told_and_nothing_is_lost(opened, scenario, trigger):
    """The kernel refuses to let any file grow (EFBIG), in the middle of the work."""

    async def steps():
        async with opened() as records:
            before = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, before[1]))
            try:
                with pytest.raises(RecordsError, check=because(messages.DISK_FULL, messages.DISK_FAILED)):
                    await begin_many(records, (bulky(trigger, 40_000) for _ in range(100)))
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, before)
            count = len((await records.open_inspections()).running)
            assert count > 0
            sequence = await records.begin(trigger)
            running = (await records.open_inspections()).running
            assert running == (*((number, 7) for number in range(1, count + 1)), (sequence, 7))

    scenario(steps)


def test_a_read_only_disk_is_told(opened, scenario, trigger, passed, small_disk):
    def remount(how):
        subprocess.run(["mount", "-o", f"remount,{how}", small_disk], check=True)

    async def steps():
        async with opened(small_disk) as records:
            await records.begin(trigger)
        remount("ro")
        with pytest.raises(ReadOnlyError, check=because(messages.NOT_WRITABLE)):
            async with opened(small_disk):
                pass
        remount("rw")
        async with opened(small_disk) as records:
            assert records.lost == (1,)

    scenario(steps)


def test_a_database_that_becomes_read_only_is_told_and_got_over(opened, scenario, trigger):
    async def steps():
        async with opened() as records:
            await _run_in_writer(records, lambda connection: connection.exec_driver_sql("PRAGMA query_only = 1"))
            with pytest.raises(ReadOnlyError, check=because(messages.NOT_WRITABLE)):
                await records.begin(trigger)
            assert await records.begin(trigger), "the next one has a new connection"
            assert records.status().failures == {"read_only": 1}

    scenario(steps)


def test_failures_are_counted_over_each_opening_and_while_there_is_none(opened, scenario, trigger, monkeypatch):
    def read_only(*_):
        raise ReadOnlyError(messages.NOT_WRITABLE(place="records", words="no"), messages.MAKE_WRITABLE())

    async def steps():
        async with opened() as records:
            await _run_in_writer(records, lambda connection: connection.exec_driver_sql("PRAGMA query_only = 1"))
            with pytest.raises(ReadOnlyError):
                await records.begin(trigger)
            await records.reopen()
            assert records.status().failures == {"read_only": 1}
            monkeypatch.setattr("station.records.records.open_records", read_only)
            with pytest.raises(ReadOnlyError):
                await records.reopen()
            assert records.status().failures == {"read_only": 2}

    scenario(steps)


async def _run_in_writer(records, work):
    return await asyncio.wrap_future(records._opened.writer.submit(work))


@pytest.mark.parametrize("name", ["", "lock"])
def test_something_else_in_the_place_of_the_records_is_told(opened, scenario, folder, name):
    place = folder / name
    if name:
        place.mkdir(parents=True)
    else:
        place.write_text("a file")

    async def steps():
        with pytest.raises(RecordsError, check=because(messages.FILE_OR_FOLDER)):
            async with opened():
                pass

    scenario(steps)


def test_a_locked_database_is_told_and_waits_for_nobody_for_ever(opened, scenario, trigger, folder):
    async def steps():
        async with opened() as records:
            other = sqlite3.connect(folder / FILE_NAME, isolation_level=None)
            other.execute("BEGIN IMMEDIATE")
            with pytest.raises(LockedError, check=because(messages.LOCKED)):
                await records.begin(trigger)
            other.execute("ROLLBACK")
            other.close()
            assert await records.begin(trigger)

    scenario(steps)


def test_a_begin_that_came_too_late_is_withdrawn(opened, scenario, trigger):
    async def steps():
        async with opened(deadline_s=0.2) as records:
            gate = threading.Event()
            waiting = asyncio.create_task(_run_in_writer(records, lambda _: gate.wait(30)))
            await asyncio.sleep(0)
            under_way = asyncio.create_task(records.begin(trigger))
            with pytest.raises(RecordsDeadlineError, check=because(messages.TOO_SLOW)):
                await under_way
            assert records.status().failures == {"deadline": 1}
            gate.set()
            await waiting
        async with opened() as records:
            assert records.lost == ()
            assert (await records.open_inspections()).running == ()

    scenario(steps)


def test_a_published_outcome_whose_write_outlasts_the_deadline_is_counted_once(opened, scenario, trigger, passed):
    async def steps():
        async with opened(deadline_s=0.2) as records:
            outcome = await records.conclude(await records.begin(trigger), passed)
            gate = threading.Event()
            waiting = asyncio.create_task(_run_in_writer(records, lambda _: gate.wait(30)))
            await asyncio.sleep(0)
            published = [asyncio.create_task(records.published(outcome)) for _ in range(2)]
            with pytest.raises(RecordsDeadlineError):
                await records.open_inspections()  # which comes after them
            gate.set()
            await waiting
            assert await asyncio.gather(*published) == [True, False]

    scenario(steps)


def test_a_begin_withdrawn_while_the_records_close_is_withdrawn(opened, scenario, trigger, monkeypatch):
    """Its answer comes when the writer takes nothing more from outside."""
    gate = threading.Event()
    save = HighWaterMark.save

    def slowly(self: HighWaterMark) -> None:
        gate.wait(30)
        save(self)

    async def steps():
        async with opened(deadline_s=0.2) as records:
            while not records._opened.images._counted:  # its thread waits for the writer, whose end waits for it
                await asyncio.sleep(0.005)
            with monkeypatch.context() as patch:
                patch.setattr(HighWaterMark, "save", slowly)
                with pytest.raises(RecordsDeadlineError, check=because(messages.TOO_SLOW)):
                    await records.begin(trigger)
                closing = asyncio.create_task(records.close())
                while records._opened is not None and not records._opened.writer._closed:
                    await asyncio.sleep(0.005)
                gate.set()
                await closing
        async with opened() as records:
            assert records.lost == ()
            assert (await records.open_inspections()).running == ()

    scenario(steps)


def test_a_begin_whose_caller_has_gone_is_withdrawn_even_when_it_is_durable(opened, scenario, trigger, monkeypatch):
    inserted, gate = threading.Event(), threading.Event()
    save = HighWaterMark.save

    def slow(self):
        inserted.set()
        gate.wait(30)
        save(self)

    async def steps():
        async with opened() as records:
            monkeypatch.setattr(HighWaterMark, "save", slow)
            caller = asyncio.create_task(records.begin(trigger))
            while not inserted.is_set():
                await asyncio.sleep(0.005)
            caller.cancel()
            with pytest.raises(asyncio.CancelledError):
                await caller
            gate.set()
            assert await records.begin(trigger) == 2, "its number is not given again"
            assert (await records.open_inspections()).running == ((2, 7),)

    scenario(steps)


def _damage_middle(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[4096:] = random.Random(3).randbytes(len(content) - 4096)
    path.write_bytes(content)


DAMAGES = {
    "middle": _damage_middle,
    "head": lambda path: path.write_bytes(b"no database at all" * 1000),
    "cut": lambda path: os.truncate(path, path.stat().st_size // 2 + 100),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_database_is_moved_aside_and_the_numbers_go_on(
    opened, scenario, trigger, failed, folder, noise, settled, damage
):
    async def steps():
        async with opened() as records:
            for _ in range(3):
                sequence = await records.begin(trigger)
                await records.conclude(sequence, replace(failed, images=(noise(),)))
            await settled(records)
        DAMAGES[damage](folder / FILE_NAME)
        async with opened() as records:
            (notice,) = records.notices
            assert notice.code == "damaged"
            assert (notice.cause.id, notice.cause.parameters["number"]) == (messages.BEGUN_ANEW.id, 3)
            (aside,) = (folder / "aside").iterdir()
            assert notice.remedy == messages.RECOVER_OLD(folder=str(aside))
            assert (aside / FILE_NAME).exists()
            assert len(list((aside / "images").glob("*/*.png"))) == 3, "their images are evidence"
            assert await records.begin(trigger) == 4
        async with opened() as records:
            assert records.notices == (notice,), "its alarm is not stored yet"
            await records.forget_notices()
        async with opened() as records:
            assert records.notices == ()
            assert await records.begin(trigger) == 5

    scenario(steps)


def remove(path: Path) -> None:
    for file in path.parent.glob(f"{FILE_NAME}*"):
        file.unlink()


@pytest.mark.parametrize("lose", [_damage_middle, remove])
def test_a_loss_is_noticed_and_moved_aside_once_however_many_openings_fail(
    opened, scenario, trigger, failed, folder, noise, settled, monkeypatch, lose
):
    def full(*_of: object) -> None:
        (folder / FILE_NAME).touch()
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            await records.conclude(sequence, replace(failed, images=(noise(),)))
            await settled(records)
        lose(folder / FILE_NAME)
        with monkeypatch.context() as patch:
            patch.setattr("station.records.open.migrate", full)
            for _ in range(3):
                with pytest.raises(DiskFullError):
                    async with opened():
                        pass
        with monkeypatch.context() as patch:
            patch.setattr("station.records.open.own_public_key", full)
            with pytest.raises(DiskFullError):
                async with opened():
                    pass
        async with opened() as records:
            (notice,) = records.notices
            (aside,) = (folder / "aside").iterdir()
            assert notice.aside == notice.remedy.parameters["folder"] == str(aside)
            assert len(list((aside / "images").glob("*/*.png"))) == 1
            assert (aside / FILE_NAME).exists() == (lose is _damage_middle)
            assert await records.begin(trigger) == sequence + 1

    scenario(steps)


def test_a_second_loss_before_the_alarm_of_the_first_is_stored_is_moved_to_a_folder_of_its_own(
    opened, scenario, trigger, folder
):
    async def steps():
        async with opened() as records:
            await records.begin(trigger)
        for number in (1, 2):
            _damage_middle(folder / FILE_NAME)
            async with opened() as records:
                (notice,) = records.notices
                assert notice.aside == str(max((folder / "aside").iterdir()))
                assert len(list(folder.glob(f"aside/*/{FILE_NAME}"))) == number

    scenario(steps)


def test_a_database_taken_away_is_noticed_and_begun_anew_on_demand(
    opened, scenario, trigger, failed, folder, noise, settled
):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            outcome = await records.conclude(sequence, replace(failed, images=(noise(),)))
            await settled(records)
            for file in folder.glob(f"{FILE_NAME}*"):
                file.unlink()
            for _ in range(2):
                with pytest.raises(DamagedError, check=because(messages.REMOVED)):
                    await records.begin(trigger)
            await records.reopen()
            (notice,) = records.notices
            assert notice.cause.id == messages.MISSING_DATABASE.id
            assert len(list(folder.glob("aside/*/images/*/*.png"))) == 1, "no images are taken for orphans"
            assert await records.published(outcome), "what only the interface still knows is taken from it"
            full = read_record(records, sequence)
            assert (full.standing, full.judged, full.trigger.lot) == (outcome, None, "A-17")
            assert await records.begin(trigger) > sequence

    scenario(steps)


def test_an_inspection_whose_database_was_taken_away_is_concluded_in_the_new_one(
    opened, scenario, trigger, failed, folder, run_records
):
    async def steps():
        async with opened() as records:
            await records.published(await records.conclude(await records.begin(trigger), failed))
            sequence = await records.begin(trigger)
            for file in folder.glob("records.sqlite3*"):
                file.unlink()
            with pytest.raises(DamagedError, check=because(messages.REMOVED)):
                await records.find_damage()
            with pytest.raises(DamagedError, check=because(messages.REMOVED)):
                await records.conclude(sequence, failed, trigger)
            await records.reopen()
            with pytest.raises(UnknownInspectionError):
                await records.conclude(sequence, failed)
            await records.published(await records.conclude(sequence, failed, trigger))
            full = read_record(records, sequence)
            assert (full.trigger, full.judged.outcome, full.judged.curve) == (trigger, "FAIL", failed.curve)

    scenario(steps)
    found = run_records("check").output
    assert "fault" not in found.replace("fault: the audit trail: row", "")
    assert "which one was the last was not known" in found or "was known to be the last" in found


def test_damaged_pages_that_nobody_reads_are_found(opened, scenario, trigger, folder):
    async def steps():
        async with opened() as records:
            for _ in range(40):
                await records.begin(bulky(trigger, 4000))
            await records.find_damage()
            await records.reopen()
            with (folder / FILE_NAME).open("r+b") as file:
                file.seek(40_960)
                file.write(random.Random(3).randbytes(40_960))
            with pytest.raises(DamagedError):
                await records.find_damage()

    scenario(steps)


def test_damage_found_while_running_is_told_and_got_over_by_reopening(opened, scenario, trigger, folder):
    async def steps():
        async with opened() as records:
            for _ in range(40):
                await records.begin(bulky(trigger, 4000))
            await records.reopen()
            with (folder / FILE_NAME).open("r+b") as file:
                file.seek(4096)
                file.write(random.Random(3).randbytes((folder / FILE_NAME).stat().st_size - 4096))
            with pytest.raises(DamagedError):
                await begin_many(records, (bulky(trigger, 4000) for _ in range(50)))
            await records.reopen()
            assert [notice.code for notice in records.notices] == ["damaged"]
            assert await records.begin(trigger) > 40

    scenario(steps)


def test_numbers_are_refused_when_nothing_tells_which_were_given(opened, scenario, trigger, folder):
    async def steps():
        async with opened() as records:
            assert await records.begin(trigger) == 1
        (folder / FILE_NAME).write_bytes(b"nothing" * 5000)
        (folder / MARK_NAME).write_bytes(b"\0" * 40)
        with pytest.raises(SequenceError, check=because(messages.NUMBERS_UNKNOWN)):
            async with opened():
                pass
        assert not (folder / "aside").exists(), "nothing was changed"
        result = CliRunner(env={"STATION_HOME": str(folder.parent)}).invoke(cli, ["records", "continue-after", "700"])
        assert (result.output, result.exit_code) == ("the next inspection is number 701\n", 0)
        async with opened() as records:
            assert await records.begin(trigger) == 701

    scenario(steps)


@pytest.mark.parametrize("mark_left", [True, False])
def test_a_command_makes_no_new_database_where_one_was_lost_and_the_images_stay(
    opened, scenario, trigger, failed, noise, settled, folder, *, mark_left
):
    async def inspect():
        async with opened() as records:
            await records.conclude(await records.begin(trigger), replace(failed, images=(noise(),)))
            await settled(records)

    async def start():
        async with opened():
            pass

    scenario(inspect)
    for lost in (*folder.glob(f"{FILE_NAME}*"), *([] if mark_left else [folder / MARK_NAME])):
        lost.unlink()
    with (
        pytest.raises(RecordsError, check=because(messages.NO_RECORDS)),
        direct_transaction(folder) as connection,
    ):
        append_audit(connection, AuditEntry("ada", "service", "calibration.stored", "scale"))
    assert not (folder / FILE_NAME).exists()
    if mark_left:
        scenario(start)
    else:
        with pytest.raises(SequenceError, check=because(messages.NUMBERS_UNKNOWN)):
            scenario(start)
    assert len(list(folder.glob("aside/*/images/*/*.png" if mark_left else "images/*/*.png"))) == 1


def test_a_lost_mark_is_taken_from_the_database_and_an_old_database_from_the_mark(opened, scenario, trigger, folder):
    async def steps():
        async with opened() as records:
            assert await records.begin(trigger) == 1
        (folder / MARK_NAME).unlink()
        old = folder / FILE_NAME
        copy = old.read_bytes()
        async with opened() as records:
            assert [await records.begin(trigger) for _ in range(2)] == [2, 3]
        old.write_bytes(copy)
        async with opened() as records:
            assert await records.begin(trigger) == 4, "a copy put back gives no number twice"

    scenario(steps)


@pytest.mark.parametrize("cut", range(0, 41, 4))
def test_a_torn_mark_costs_at_most_the_write_that_tore_it(tmp_path, cut):
    path = tmp_path / "sequence"
    mark = HighWaterMark(path)
    for value in (5, 6, 8, 11):
        mark.value = value
        mark.save()
    before = path.read_bytes()
    mark.value = 12
    mark.save()
    after = path.read_bytes()
    changed = [place for place in range(40) if before[place] != after[place]]
    torn = bytearray(before)
    for place in changed[: len(changed) * cut // 40]:
        torn[place] = after[place]
    path.write_bytes(torn)
    assert HighWaterMark(path).value in {11, 12}
    assert HighWaterMark(path).known


@contextlib.contextmanager
def no_permission(folder: Path) -> Iterator[None]:
    """A folder that the station's user may not enter, as one that root put back; root itself becomes nobody."""
    folder.chmod(0)
    if os.geteuid() == 0:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(os.getuid())
        folder.chmod(0o700)


def test_a_folder_that_cannot_be_entered_is_an_error_of_the_records(opened, scenario, folder):
    async def steps():
        async with opened() as records:
            assert records.status().database_bytes > 0
            with no_permission(folder):
                assert records.status().database_bytes == 0
                with pytest.raises(ReadOnlyError, check=because(messages.NOT_WRITABLE)):
                    await records.find_damage()
                with pytest.raises(ReadOnlyError, check=because(messages.NOT_WRITABLE)):
                    read_record(records, 1)
                with pytest.raises(ReadOnlyError, check=because(messages.NOT_WRITABLE)), short_transaction(folder):
                    pass
            await records.find_damage()

    scenario(steps)


def test_a_file_that_vanishes_while_it_is_looked_at_has_no_size(opened, scenario, folder, monkeypatch):
    async def steps():
        async with opened() as records:
            await records.close()
            (folder / FILE_NAME).unlink()
            monkeypatch.setattr(Path, "exists", lambda _: True)
            assert records.status().database_bytes == 0
            monkeypatch.undo()

    scenario(steps)
