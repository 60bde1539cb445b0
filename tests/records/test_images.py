"""Stored images: of which fruit, for how long, and the state of those that are not."""

import asyncio
import errno
import shutil
import sqlite3
import threading
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import event

from station.messages import records as messages
from station.messages.message import verbatim
from station.records.database import FILE_NAME, open_engine
from station.records.errors import DiskFullError
from station.records.holds import hold
from station.records.images import MB, ImageStore, accepted_is_stored
from station.records.migration import migrate
from station.records.model import Image
from station.records.retention import remove_oldest_images
from tests.records.causes import because
from tests.stored_inspection import read_record


@pytest.fixture
def inspected(trigger, passed, failed):
    """Inspect one fruit with these images, and give its number."""

    async def inspect(records, *images, accepted=False):
        sequence = await records.begin(trigger)
        outcome = await records.conclude(sequence, replace(passed if accepted else failed, images=images))
        await records.published(outcome)
        return sequence

    return inspect


def test_a_rejected_fruits_images_are_kept_without_loss(opened, scenario, inspected, noise, settled):
    mask = Image("mask", 0, np.eye(9, dtype=np.uint8) * 255)
    images = (noise("reference", None), noise(), mask)

    async def steps():
        async with opened() as records:
            sequence = await inspected(records, *images)
            await settled(records)
            full = read_record(records, sequence)
            assert full.images_state == messages.IMAGES_KEPT()
            assert [(image.kind, image.step) for image in full.images] == [
                ("reference", None),
                ("step", 0),
                ("mask", 0),
            ]
            for stored, given_image in zip(full.images, images, strict=True):
                read = cv2.imread(stored.path, cv2.IMREAD_UNCHANGED)
                assert read is not None
                assert np.array_equal(read, given_image.pixels)
            assert records.status().images == {"kept": 3}
            files = (records.folder / "images").glob("*/*.png")
            assert sorted(file.stat().st_size for file in files) == sorted(image.size_bytes for image in full.images)
            assert records.status().image_bytes == sum(image.size_bytes for image in full.images)

    scenario(steps)


def test_a_share_of_the_accepted_is_kept(opened, scenario, inspected, noise, settled):
    async def steps():
        async with opened(accepted_share=0.25, images_queue=64) as records:
            numbers = [await inspected(records, noise(), accepted=True) for _ in range(8)]
            await settled(records)
            states = [read_record(records, number).images_state for number in numbers]
            assert states == [*[messages.IMAGES_NOT_WANTED()] * 3, messages.IMAGES_KEPT()] * 2

    scenario(steps)


@given(st.integers(0, 2**32 - 200), st.floats(0, 1))
def test_the_share_is_evenly_spread(first, share):
    stored = sum(accepted_is_stored(sequence, share) for sequence in range(first + 1, first + 101))
    assert abs(stored - 100 * share) <= 1 + 1e-6


def test_beyond_the_quota_the_oldest_accepted_go_first_then_the_oldest_rejected(
    opened, scenario, inspected, noise, settled
):
    """An image is 0.3 MB, so that 3 fit."""

    async def steps():
        async with opened(accepted_share=1.0, images_quota_mb=1) as records:

            async def add(*, accepted):
                number = await inspected(records, noise(side_px=315), accepted=accepted)
                await settled(records)
                return number

            async def stored():
                return [n for n in numbers if read_record(records, n).images_state == messages.IMAGES_KEPT()]

            numbers = [await add(accepted=False), await add(accepted=True), await add(accepted=True)]
            assert await stored() == [1, 2, 3]
            numbers.append(await add(accepted=True))
            assert await stored() == [1, 3, 4], "the oldest accepted went"
            numbers += [await add(accepted=False), await add(accepted=False)]
            assert await stored() == [1, 5, 6], "the accepted went before any rejected"
            numbers.append(await add(accepted=True))
            assert await stored() == [1, 5, 6], "an accepted one pushes out no rejected one"
            last = read_record(records, 7)
            assert last.images_state == messages.IMAGES_DROPPED(cause=messages.QUOTA_FULL())
            numbers.append(await add(accepted=False))
            assert await stored() == [5, 6, 8]
            assert read_record(records, 1).images_state == messages.IMAGES_REMOVED()
            files = list((records.folder / "images").glob("*/*"))
            assert len(files) == 3
            assert records.status().image_bytes == sum(file.stat().st_size for file in files)
            assert read_record(records, 1).judged is not None, "its record stays"

    scenario(steps)


def test_accepted_fruit_beyond_a_quota_that_is_full_of_rejected_ones_is_no_loss(
    opened, scenario, inspected, noise, settled
):
    async def steps():
        async with opened(accepted_share=1.0, images_quota_mb=1) as records:
            for _ in range(3):
                await inspected(records, noise(side_px=315))
                await settled(records)
            number = await inspected(records, noise(side_px=315), accepted=True)
            await settled(records)
            assert read_record(records, number).images_state == messages.IMAGES_DROPPED(cause=messages.QUOTA_FULL())
            assert records.status().images == {"kept": 3, "over_quota": 1}

    scenario(steps)


@pytest.fixture
def removed():
    """Wait until so many images were removed since the opening."""

    async def wait(records, number):
        while records.status().images.get("removed", 0) < number:
            await asyncio.sleep(0.005)

    return wait


def test_a_lowered_quota_is_kept_from_the_next_start_and_what_is_on_hold_stays(
    opened, scenario, inspected, noise, settled, removed
):
    async def steps():
        async with opened() as records:
            numbers = [await inspected(records, noise(side_px=315)) for _ in range(3)]
            await settled(records)
            await records.change(lambda connection: hold(connection, numbers[1], "complaint", "ada"))
        async with opened(images_quota_mb=0) as records:
            await removed(records, 2)
            states = [read_record(records, number).images_state for number in numbers]
            assert states == [messages.IMAGES_REMOVED(), messages.IMAGES_KEPT(), messages.IMAGES_REMOVED()]
            (held,) = read_record(records, numbers[1]).images
            assert [str(file) for file in (records.folder / "images").glob("*/*")] == [held.path]
            assert records.status().image_bytes == held.size_bytes

    scenario(steps)


def test_below_the_reserve_images_go_at_the_next_opening_so_that_inspections_begin_again(
    opened, scenario, trigger, inspected, noise, settled, removed, folder, monkeypatch
):
    """An image is 0.3 MB, and the reserve 1 MB; images are removed until twice as much is free."""
    space_mb = 9.0

    def disk_usage(_path):
        used_bytes = sum(file.stat().st_size for file in folder.glob("images/*/*"))
        return shutil._ntuple_diskusage(10**9, 0, int(space_mb * MB) - used_bytes)

    monkeypatch.setattr(shutil, "disk_usage", disk_usage)

    async def steps():
        nonlocal space_mb
        async with opened(accepted_share=1.0) as records:
            numbers = [await inspected(records, noise(side_px=315), accepted=accepted) for accepted in (0, 1, 0)]
            await settled(records)
            space_mb = 2.75
            await records.reopen()
            await removed(records, 1)
            states = [read_record(records, number).images_state for number in numbers]
            assert states == [messages.IMAGES_KEPT(), messages.IMAGES_REMOVED(), messages.IMAGES_KEPT()], (
                "accepted first"
            )
            space_mb = 1.5
            with pytest.raises(DiskFullError, check=because(messages.RESERVE_REACHED)):
                await records.begin(trigger)
            await records.reopen()
            await removed(records, 2)
            last = await inspected(records, noise())
            await settled(records)
            assert read_record(records, last).images_state == messages.IMAGES_DROPPED(cause=messages.DISK_NEARLY_FULL())

    scenario(steps)


def test_a_close_does_not_wait_until_all_images_too_many_are_removed(
    opened, scenario, inspected, noise, settled, monkeypatch
):
    removing, gate = threading.Event(), threading.Event()
    removals = []

    def remove(_connection, *, for_accepted):
        removing.set()
        gate.wait(30)
        removals.append(for_accepted)
        return (0, []) if len(removals) < 20 else None

    monkeypatch.setattr("station.records.images.remove_oldest_images", remove)
    monkeypatch.setattr("station.records.records.IMAGES_CLOSE_S", 0.0)

    async def steps():
        async with opened() as records:
            await inspected(records, noise())
            await settled(records)
        async with opened(images_quota_mb=0) as records:
            images = records._opened.images
            assert await asyncio.to_thread(removing.wait, 30)
            closing = asyncio.create_task(records.close())
            while not images._stopping.is_set():
                await asyncio.sleep(0.005)
            gate.set()
            await closing
        assert removals == [False]

    scenario(steps)


def test_what_goes_first_is_sought_among_the_images_and_not_among_all_fruit_ever_inspected(tmp_path):
    engine = open_engine(tmp_path / FILE_NAME, "rwc")
    migrate(engine, tmp_path)
    plans = []

    def explain(connection, _cursor, statement, parameters, _context, _many):
        found = connection.connection.driver_connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)
        plans.append([row[3] for row in found])

    with engine.begin() as connection:
        event.listen(engine, "before_cursor_execute", explain)
        assert remove_oldest_images(connection, for_accepted=False) is None
    assert len(plans) == 2, "the accepted ones, then the others"
    for first, *further in plans:
        assert first == "SCAN images USING COVERING INDEX ix_images_sequence"
        assert not any("ix_inspections" in step or "TEMP B-TREE" in step for step in further), further


def test_no_name_of_a_later_image_is_interned(opened, scenario, inspected, noise, settled, interned):
    async def steps():
        async with opened(images_quota_mb=1) as records:

            async def add():
                number = await inspected(records, noise(side_px=315))
                await settled(records)
                assert len(read_record(records, number).images) == 1
                assert records.status().database_bytes > 0

            for _ in range(5):
                await add()
            before = set(interned)
            for _ in range(3):
                await add()
            assert records.status().images == {"kept": 8, "removed": 5}
            assert set(interned) == before

    scenario(steps)


def test_images_larger_than_the_quota_are_dropped_and_it_is_said(opened, scenario, inspected, noise, settled):
    async def steps():
        async with opened(images_quota_mb=1) as records:
            sequence = await inspected(records, *(noise(side_px=315) for _ in range(4)))
            await settled(records)
            assert "images_quota_mb allows 1000000" in str(read_record(records, sequence).images_state)
        async with opened(images_quota_mb=0) as records:
            sequence = await inspected(records, noise())
            assert read_record(records, sequence).images_state == messages.IMAGES_NOT_WANTED()

    scenario(steps)


def test_a_slow_disk_drops_images_and_never_holds_up_an_inspection(
    opened, scenario, inspected, noise, settled, monkeypatch
):
    gate = threading.Event()
    write = ImageStore._write

    def slow(self, path, content):
        gate.wait(30)
        write(self, path, content)

    monkeypatch.setattr(ImageStore, "_write", slow)

    async def steps():
        async with opened(images_queue=2) as records:
            numbers = [await inspected(records, noise()) for _ in range(4)]
            states = [read_record(records, number).images_state for number in numbers]
            assert (
                states
                == [messages.IMAGES_PENDING()] * 2 + [messages.IMAGES_DROPPED(cause=messages.TOO_MANY_WAIT())] * 2
            )
            gate.set()
            await settled(records)
            states = [read_record(records, number).images_state for number in numbers[:2]]
            assert states == [messages.IMAGES_KEPT()] * 2
            assert records.status().images == {"kept": 2, "dropped": 2}

    scenario(steps)


def test_a_disk_that_fills_up_among_the_images_costs_no_record(
    opened, scenario, inspected, noise, settled, monkeypatch
):
    write = ImageStore._write
    written: list[Path] = []

    def full(self, path, content):
        if len(written) == 2:
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(path)
        write(self, path, content)

    monkeypatch.setattr(ImageStore, "_write", full)

    async def steps():
        async with opened() as records:
            sequence = await inspected(records, noise(), noise(), noise())
            await settled(records)
            found = read_record(records, sequence)
            assert found.standing is not None
            assert found.standing.outcome == "FAIL"
            assert len(found.images) == 2
            assert found.images_state.id == messages.IMAGES_PARTLY.id
            assert messages.DISK_FULL.id in found.images_state.ids()
            assert (found.images_state.parameters["kept"], found.images_state.parameters["number"]) == (2, 3)
            assert records.status().images == {"kept": 2, "failed": 1}

    scenario(steps)


def test_what_no_png_can_hold_is_said(opened, scenario, inspected, settled):
    async def steps():
        async with opened() as records:
            sequence = await inspected(records, Image("step", 0, np.zeros((4, 4, 7), dtype=np.uint8)))
            await settled(records)
            assert read_record(records, sequence).images_state.id == messages.IMAGES_DROPPED.id
            assert records.status().images == {"failed": 1}

    scenario(steps)


def test_a_start_removes_files_that_nothing_refers_to_and_says_which_images_were_lost(
    opened, scenario, inspected, noise, settled
):
    async def steps():
        async with opened() as records:
            whole = await inspected(records, noise())
            lost = await inspected(records, noise())
            await settled(records)
            folder = records.folder / "images"
            (image,) = read_record(records, whole).images
            orphans = [folder / "ab" / f"ab{'0' * 62}.png", folder / image.sha256[:2] / "x.partial"]
            for orphan in orphans:
                orphan.parent.mkdir(exist_ok=True)
                orphan.write_bytes(b"half an image")
        _pretend_pending(records.folder, lost)
        async with opened() as records:
            while any(orphan.exists() for orphan in orphans):
                await asyncio.sleep(0.01)
            assert image.path in set(map(str, folder.glob("*/*.png")))
            assert read_record(records, lost).images_state == messages.IMAGES_LOST()

    scenario(steps)


def _pretend_pending(folder, sequence):
    connection = sqlite3.connect(folder / "records.sqlite3")
    with connection:
        connection.execute("DELETE FROM images WHERE sequence = ?", (sequence,))
        connection.execute("UPDATE inspections SET images_state = 'pending' WHERE sequence = ?", (sequence,))
    connection.close()


@pytest.mark.parametrize(
    ("stored", "state"),
    [
        ("kept", messages.IMAGES_KEPT()),
        ("not wanted", messages.IMAGES_NOT_WANTED()),
        ("dropped: the quota is full", verbatim("dropped: the quota is full")),
        ("", None),
    ],
)
def test_states_of_before_messages_read_the_same(opened, scenario, inspected, noise, settled, stored, state):
    async def steps():
        async with opened() as records:
            number = await inspected(records, noise())
            await settled(records)
            connection = sqlite3.connect(records.folder / "records.sqlite3")
            with connection:
                connection.execute("UPDATE inspections SET images_state = ? WHERE sequence = ?", (stored, number))
            connection.close()
            assert read_record(records, number).images_state == state

    scenario(steps)
