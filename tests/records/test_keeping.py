"""Held images stay; a copy is whole; a check finds what is wrong; and what is put back goes on."""

import asyncio
import errno
import json
import shutil
import sqlite3
from dataclasses import replace

import pytest

from station.messages import records as messages
from station.records.audit_report import read_audit
from station.records.backup import MANIFEST_NAME, make_backup
from station.records.database import FILE_NAME, reading
from station.records.errors import DamagedError, DiskFullError, LockedError, RecordsError
from station.records.holds import hold, release
from station.records.integrity_check import check_records
from station.records.model import OpenInspections
from station.records.restore import restore_backup
from station.records.signing import public_keys_of
from tests.records.causes import because
from tests.stored_inspection import read_record


@pytest.fixture
def inspected(trigger, failed, settled):
    """Inspect so many rejected fruit, each with these images."""

    async def inspect(records, number, *images):
        for _ in range(number):
            sequence = await records.begin(trigger)
            await records.published(await records.conclude(sequence, replace(failed, images=images)))
            await settled(records)

    return inspect


def names(folder):
    return sorted(file.stem for file in (folder / "images").glob("*/*.png"))


def test_what_is_on_hold_stays_until_it_is_released(opened, scenario, inspected, noise, folder, run_records):
    """An image is 0.3 MB, so that 3 fit."""

    async def steps():
        async with opened(images_quota_mb=1) as records:
            for _ in range(3):
                await inspected(records, 1, noise(side_px=320))
            result = await asyncio.to_thread(run_records, "hold", 1, "--reason", "a complaint", "--by", "ada")
            assert "the images of inspection 1 are retained" in result.output
            assert result.output.endswith("stored of it: 1 images (kept)\n")
            for _ in range(2):
                await inspected(records, 1, noise(side_px=320))
            states = [read_record(records, number).images_state for number in (1, 2, 3)]
            assert states == [messages.IMAGES_KEPT(), *[messages.IMAGES_REMOVED()] * 2]
            await records.change(lambda connection: hold(connection, "A-17", "the whole lot", "ada"))
            await inspected(records, 1, noise(side_px=320))
            last = read_record(records, 6)
            assert last.images_state == messages.IMAGES_DROPPED(cause=messages.QUOTA_FULL())
            assert records.status().images["dropped"] == 1, "a rejected fruit's images are lost"
            await records.change(lambda connection: release(connection, "A-17", "all is well", "ada"))
            assert (await asyncio.to_thread(run_records, "release", 1, "--reason", "answered")).exit_code == 0
            await inspected(records, 1, noise(side_px=320))
            assert read_record(records, 1).images_state == messages.IMAGES_REMOVED()

    scenario(steps)
    assert run_records("holds").output == ""
    again = run_records("hold", 1, "--reason", "too late").output
    assert again.endswith("stored of it: 0 images (removed: space for newer ones)\n")
    assert run_records("hold", "A-17", "--reason", "the lot").output.endswith(
        "stored of it: images of 3 of 7 inspections\n"
    )
    for arguments in (("release", 1), ("release", "A-17")):
        assert run_records(*arguments, "--reason", "tried").exit_code == 0
    for arguments in (("hold", 99), ("release", 1), ("hold", "nowhere")):
        result = run_records(*arguments, "--reason", "why not")
        assert result.exit_code == 1
        assert "records list` shows" in str(result.exception) or "are not retained" in str(result.exception)
    assert run_records("hold", 1, "--reason", " ").exit_code == 1


def test_a_lot_that_is_named_by_a_number_is_not_taken_for_an_inspection(opened, scenario, passed, trigger, run_records):
    async def steps():
        async with opened() as records:
            for lot in ("2", "A-17"):
                await records.published(await records.conclude(await records.begin(replace(trigger, lot=lot)), passed))

    scenario(steps)
    for command in ("hold", "release"):
        refused = run_records(command, 2, "--reason", "a complaint")
        assert (refused.exit_code, refused.exception.cause) == (1, messages.NUMBER_AND_LOT(lot="2"))
    assert "inspection 1 are retained" in run_records("hold", 1, "--reason", "no lot has that name").output
    assert "lot 2 are retained" in run_records("hold", 2, "--lot", "--reason", "a complaint").output
    held = run_records("hold", 2, "--inspection", "--reason", "a complaint").output
    assert "inspection 2 are retained" in held
    assert held.endswith("stored of it: 0 images (not kept, by the settings of the records)\n")


def test_a_backup_while_the_station_writes_is_whole_and_can_be_put_back(
    opened, scenario, inspected, noise, folder, tmp_path, run_records
):
    copy = tmp_path / "copy"

    async def steps():
        async with opened() as records:
            await inspected(records, 3, noise())
            writing = asyncio.create_task(inspected(records, 10, noise()))
            made = await asyncio.to_thread(make_backup, folder, copy)
            await writing
            assert 3 <= made.inspections <= 13
            assert made.notes == ()
            with pytest.raises(LockedError, check=because(messages.ANOTHER_STATION)):
                await asyncio.to_thread(restore_backup, folder, copy, "ada", public_keys_of(folder))
        return made

    made = scenario(steps)
    assert run_records("backup", copy).exception.cause == messages.THERE_ALREADY(path=str(copy))
    last = sqlite3.connect(folder / FILE_NAME).execute("SELECT max(sequence) FROM inspections").fetchone()[0]
    shutil.rmtree(folder / "images")
    result = run_records("restore", copy, "--by", "ada")
    assert f"restored {made.inspections} inspections and {made.images} images" in result.output
    found = check_records(folder)
    assert (found.faults, found.inspections, found.images) == ((), made.inspections, made.images)
    (aside,) = (folder / "aside").iterdir()
    assert sqlite3.connect(aside / FILE_NAME).execute("SELECT max(sequence) FROM inspections").fetchone()[0] == last

    async def goes_on():
        async with opened() as records:
            await inspected(records, 1, noise())
            assert read_record(records, last + 1).images_state == messages.IMAGES_KEPT(), "no number is given twice"

    scenario(goes_on)


def test_a_fruit_that_ran_while_the_backup_was_made_has_no_invented_outcome_after_its_restore(
    opened, scenario, inspected, noise, folder, tmp_path, run_records, trigger, passed
):
    async def before():
        async with opened() as records:
            await inspected(records, 1, noise())
            running = await records.begin(trigger)
            made = await asyncio.to_thread(make_backup, folder, tmp_path / "copy")
            assert (made.inspections, made.sequence) == (1, running)
            await records.published(await records.conclude(running, passed))
            await records.acknowledged(running)

    async def after():
        async with opened() as records:
            assert records.lost == ()
            assert [outcome.sequence for outcome in (await records.open_inspections()).ended] == [1]
            await records.acknowledged(2)
            assert await records.open_inspections() == OpenInspections((), ())
            await inspected(records, 1, noise())
            assert read_record(records, 3).standing is not None

    scenario(before)
    restore_backup(folder, tmp_path / "copy", "ada", public_keys_of(folder))
    assert check_records(folder).faults == ()
    scenario(after)
    assert check_records(folder).faults == ()
    with reading(folder) as connection:
        (skipped,) = read_audit(connection, 9, "numbers.skipped")
    assert skipped.subject == "2"


@pytest.mark.parametrize("spoiled", [FILE_NAME, "image", MANIFEST_NAME])
def test_a_backup_that_is_not_whole_is_not_put_back(opened, scenario, inspected, noise, folder, tmp_path, spoiled):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    scenario(steps)
    make_backup(folder, tmp_path / "copy")
    path = tmp_path / "copy" / spoiled
    if spoiled == "image":
        (path,) = (tmp_path / "copy" / "images").glob("*/*.png")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)
    before = (folder / FILE_NAME).read_bytes()
    with pytest.raises(
        DamagedError,
        check=because(messages.OTHER_CONTENT, messages.BACKUP_OTHER_KEY, messages.NOT_THE_VERIFIED),
    ):
        restore_backup(folder, tmp_path / "copy", "ada", public_keys_of(folder))
    assert (folder / FILE_NAME).read_bytes() == before
    assert names(folder)
    assert not (folder / "aside").exists()


def test_a_backup_without_a_signature_needs_to_be_trusted(
    opened, scenario, inspected, noise, folder, tmp_path, run_records
):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    scenario(steps)
    make_backup(folder, tmp_path / "copy")
    (tmp_path / "copy" / "backup.sig").unlink()
    result = run_records("restore", tmp_path / "copy")
    assert result.exit_code == 1
    assert result.exception.cause == messages.BACKUP_UNSIGNED(path=str(tmp_path / "copy"))
    assert "results that were changed in it are then not found" in str(result.exception)
    assert "restored 1 inspections and 1 images" in run_records("restore", tmp_path / "copy", "--unverified").output
    assert run_records("check").exit_code == 0


@pytest.mark.parametrize("name", [FILE_NAME, MANIFEST_NAME, "backup.sig", "image"])
def test_a_backup_whose_file_is_a_device_is_refused_at_once(
    opened, scenario, inspected, noise, folder, tmp_path, run_records, name
):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    scenario(steps)
    make_backup(folder, tmp_path / "copy")
    path = tmp_path / "copy" / name
    if name == "image":
        (path,) = (tmp_path / "copy" / "images").glob("*/*.png")
    path.unlink()
    path.symlink_to("/dev/zero")
    result = run_records("restore", tmp_path / "copy")
    assert result.exit_code == 1
    assert "this is no file, or larger than" in str(result.exception)


def test_images_that_a_backup_could_not_copy_are_lost_after_its_restore(
    opened, scenario, inspected, noise, folder, tmp_path, run_records
):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())
            await inspected(records, 1, noise())

    scenario(steps)
    (next((folder / "images").glob("*/*.png"))).unlink()
    assert "note: 1 images were removed or missing" in run_records("backup", tmp_path / "copy").output
    assert "restored 2 inspections and 1 images" in run_records("restore", tmp_path / "copy").output
    assert run_records("check").exit_code == 0
    assert "1 of their files are missing" in run_records("show", 1).output + run_records("show", 2).output


def test_a_backup_needs_its_space_and_leaves_nothing_half_made(opened, scenario, inspected, noise, folder, small_disk):
    async def steps():
        async with opened() as records:
            for _ in range(5):
                await inspected(records, 1, noise(side_px=700))

    scenario(steps)
    with pytest.raises(DiskFullError, check=because(messages.NO_SPACE_FOR_BACKUP)):
        make_backup(folder, small_disk / "copy")
    assert list(small_disk.iterdir()) == []
    with pytest.raises(RecordsError, check=because(messages.NO_BACKUP)):
        restore_backup(folder, small_disk, "ada", None)


def test_a_backup_on_the_records_own_disk_leaves_the_station_its_reserve(
    opened, scenario, inspected, noise, folder, tmp_path, run_records, monkeypatch
):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    scenario(steps)
    monkeypatch.setenv("STATION_RECORDS_FREE_RESERVE_MB", "1000000")
    refused = run_records("backup", tmp_path / "copy")
    assert refused.exit_code == 1
    assert "the reserve that the station needs" in str(refused.exception)
    assert not (tmp_path / "copy").exists()


def test_a_restore_leaves_the_station_its_reserve(
    opened, scenario, inspected, noise, folder, tmp_path, run_records, monkeypatch
):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    scenario(steps)
    make_backup(folder, tmp_path / "copy")
    monkeypatch.setenv("STATION_RECORDS_FREE_RESERVE_MB", "1000000")
    refused = run_records("restore", tmp_path / "copy")
    assert isinstance(refused.exception, DiskFullError)
    assert "the reserve that the station needs" in str(refused.exception)
    assert not (folder / "restoring").exists()
    assert not (folder / "aside").exists()


def test_a_restore_that_fails_leaves_no_half_copy_and_a_start_removes_one_that_was_killed(
    opened, scenario, inspected, noise, folder, tmp_path, monkeypatch
):
    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    def full(*_):
        assert (folder / "restoring" / FILE_NAME).exists(), "the database is copied first"
        raise OSError(errno.ENOSPC, "No space left on device")

    scenario(steps)
    make_backup(folder, tmp_path / "copy")
    before = (folder / FILE_NAME).read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr("station.records.restore.copy_image", full)
        with pytest.raises(DiskFullError):
            restore_backup(folder, tmp_path / "copy", "ada", public_keys_of(folder))
    assert not (folder / "restoring").exists()
    assert (folder / FILE_NAME).read_bytes() == before
    assert not (folder / "aside").exists()
    (folder / "restoring" / "images").mkdir(parents=True)
    scenario(steps)
    assert not (folder / "restoring").exists()


def test_a_check_finds_what_is_wrong_and_the_next_start_reconciles(
    opened, scenario, inspected, noise, folder, run_records, trigger
):
    async def steps():
        async with opened() as records:
            for _ in range(3):
                await inspected(records, 1, noise())

    scenario(steps)
    assert "3 inspections and 3 images checked" in run_records("check").output
    first, second, _ = (folder / "images" / name[:2] / f"{name}.png" for name in names(folder))
    second.write_bytes(b"something else")
    first.rename(first.with_stem("f" * 64))
    result = run_records("check")
    assert result.exit_code == 1
    assert f"fault: {first}: missing, though an inspection refers to it" in result.output
    assert f"fault: {second}: its content is not what its name says" in result.output
    assert "note: 1 image files belong to no inspection" in result.output

    missing = messages.IMAGES_DROPPED(cause=messages.FILES_MISSING(number=1))

    async def again():
        async with opened() as records:
            await records.begin(trigger)
            while records.status().queue or not (folder / "images").exists():
                await asyncio.sleep(0.01)
            async with asyncio.timeout(20):
                while first.with_stem("f" * 64).exists():
                    await asyncio.sleep(0.01)
                states = []
                while missing not in states:
                    states = [read_record(records, number).images_state for number in (1, 2, 3)]

    scenario(again)
    with sqlite3.connect(folder / FILE_NAME) as database:
        ((details,),) = database.execute("SELECT details FROM events WHERE name = 'images_missing'").fetchall()
    assert json.loads(details) == {"sha256": [first.stem]}


def test_images_that_are_all_away_are_not_forgotten(opened, scenario, inspected, noise, folder):
    """A disk that is not mounted may come back."""

    async def steps():
        async with opened() as records:
            await inspected(records, 1, noise())

    scenario(steps)
    (folder / "images").rename(folder / "elsewhere")

    async def again():
        async with opened() as records:
            await inspected(records, 1)
            assert read_record(records, 1).images_state == messages.IMAGES_KEPT()

    scenario(again)
