"""Stored whole or not at all, and read back with care."""

import errno
import os
import shutil
from datetime import UTC, datetime, timedelta

import pytest

from station.calibration.errors import CalibrationError, UnknownCalibrationError
from station.calibration.model import GelChange, stamp
from station.calibration.report import calibration_files
from station.calibration.store import CALIBRATIONS, CalibrationStore


def test_what_is_stored_is_read_back_with_its_page_and_pictures(stored, draft):
    calibration = draft.calibration
    assert stored.current("T0001") == calibration
    assert stored.find(calibration.id) == calibration
    assert (stored.golden(calibration) == draft.reference).all()
    names = {path.name for path in stored.folder(calibration).iterdir()}
    assert {"report.html", "area.png", "field.png", "reference.png", "press_13.png", "calibration.json"} <= names
    page = (stored.folder(calibration) / "report.html").read_text()
    assert "0.0285" in page or "0.0284" in page or "0.0286" in page
    assert page.count("data:image/") == 2 + 1 + 14
    with pytest.raises(UnknownCalibrationError):
        stored.find("20000101T000000Z")


def test_the_newest_is_the_units_and_a_broken_one_is_passed_over(stored, draft, tmp_path):
    later = draft.calibration.model_copy(
        update={"id": stamp(draft.calibration.made_at + timedelta(days=1)), "operator": "ben"}
    )
    stored.add_calibration(later, {})
    assert [one.operator for one in stored.calibrations("T0001")] == ["ben", "anna"]
    (stored.folder(later) / "calibration.json").write_text('{"mm_per_px": "wide"}')
    assert stored.current("T0001") == draft.calibration
    assert stored.current("T0002") is None
    assert stored.current("../T0001") is None


def test_a_verification_belongs_to_one_calibration(stored, draft, verification):
    stored.add_verification(verification, {"reference.png": b"x"})
    assert stored.last_verification(draft.calibration) == verification
    assert verification.drift == pytest.approx(-0.02)
    newer = draft.calibration.model_copy(update={"id": stamp(draft.calibration.made_at + timedelta(days=1))})
    assert stored.last_verification(newer) is None


@pytest.mark.parametrize("number", [1, 4, 17])
def test_a_full_disk_leaves_nothing_and_keeps_the_calibration_before(store, draft, tmp_path, monkeypatch, number):
    files = calibration_files(draft)
    synced = os.fsync
    calls = 0

    def full(descriptor):
        nonlocal calls
        calls += 1
        if calls == number:
            raise OSError(errno.ENOSPC, "No space left on device")
        synced(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CalibrationError, match="No space left on device; free space there"):
        store.add_calibration(draft.calibration, files)
    assert list((tmp_path / CALIBRATIONS / "T0001").iterdir()) == []
    store.add_calibration(draft.calibration, files)
    assert store.current("T0001") == draft.calibration


def test_a_full_disk_leaves_nothing_of_a_verification(stored, draft, verification, monkeypatch):
    def full(_descriptor):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CalibrationError, match="No space left on device; free space there"):
        stored.add_verification(verification, {"reference.png": b"x"})
    assert stored.last_verification(draft.calibration) is None
    assert stored.current("T0001") == draft.calibration


def test_what_a_killed_one_left_is_never_seen_and_swept_away(store, draft, tmp_path):
    left = tmp_path / CALIBRATIONS / "T0001" / ".unfinished-1"
    left.mkdir(parents=True)
    (left / "calibration.json").write_text(draft.calibration.model_dump_json())
    assert store.current("T0001") is None
    assert store.serials() == ("T0001",)
    store.add_calibration(draft.calibration, {})
    assert not left.exists()


def test_one_that_is_being_prepared_stays_where_another_process_adds_one(store, draft, tmp_path):
    first = store.prepare_calibration(draft.calibration, {"reference.png": b"x"})
    later = draft.calibration.model_copy(update={"id": stamp(draft.calibration.made_at + timedelta(days=1))})
    CalibrationStore(tmp_path).add_calibration(later, {})
    assert (first.put_in_force() / "reference.png").read_bytes() == b"x"


def test_no_lock_is_left_of_one_that_is_in_force_or_discarded(store, draft, tmp_path):
    def held_open():
        return [file.name for file in os.scandir("/proc/self/fd") if str(tmp_path) in os.path.realpath(file.path)]

    first, second = (store.prepare_calibration(draft.calibration, {}) for _ in range(2))
    assert len(held_open()) == 2
    second.discard()
    first.put_in_force()
    assert held_open() == []


def test_a_prepared_one_is_in_force_by_its_folders_name_alone_and_can_be_taken_back(store, draft, tmp_path):
    prepared = store.prepare_calibration(draft.calibration, {})
    assert store.current("T0001") is None
    prepared.put_in_force()
    assert store.current("T0001") == draft.calibration
    twice = store.prepare_calibration(draft.calibration, {})
    with pytest.raises(CalibrationError, match=draft.calibration.id):
        twice.put_in_force()
    twice.discard()
    assert store.current("T0001") == draft.calibration, "another one's folder is not its own"
    prepared.discard()
    prepared.discard()
    assert list((tmp_path / CALIBRATIONS / "T0001").iterdir()) == []


GEL_CHANGE = GelChange(operator="ben", changed_at=datetime(2026, 11, 29, 10, 15, tzinfo=UTC))


def made_after(draft, **later):
    return draft.calibration.model_copy(update={"id": stamp(draft.calibration.made_at + timedelta(**later))})


def test_a_changed_gel_leaves_no_calibration_in_force_and_none_returns(stored, draft):
    newer, others = made_after(draft, days=1), draft.calibration.model_copy(update={"serial": "T0002"})
    stored.add_calibration(newer, {})
    stored.add_calibration(others, {})
    assert stored.gel_change("T0001") is None
    stored.mark_gel_changed("T0001", GEL_CHANGE)
    assert stored.current("T0001") is None
    assert stored.gel_change("T0001") == GEL_CHANGE
    assert stored.calibrations("T0001") == (newer, draft.calibration), "old images are measured by them"
    assert stored.current("T0002") == others
    shutil.move(stored.folder(newer), stored.folder(newer).with_name(".moved_away"))
    assert stored.current("T0001") is None


@pytest.mark.parametrize("days", [1, -1])
def test_the_calibration_after_a_changed_gel_is_in_force_also_where_the_clock_was_set_back(stored, draft, days):
    stored.mark_gel_changed("T0001", GEL_CHANGE)
    new = made_after(draft, days=days)
    stored.add_calibration(new, {})
    assert stored.current("T0001") == new
    assert [stored.is_of_earlier_gel(one) for one in (draft.calibration, new)] == [True, False]


def test_a_mark_that_cannot_be_read_counts_and_a_unit_without_a_calibration_gets_none(stored, draft, tmp_path):
    stored.mark_gel_changed("T0002", GEL_CHANGE)
    assert not (tmp_path / CALIBRATIONS / "T0002").exists()
    (tmp_path / CALIBRATIONS / "T0001" / f"{draft.calibration.id}.gel_changed").write_bytes(b"\0")
    assert stored.current("T0001") is None
    assert stored.gel_change("T0001") is None


@pytest.mark.parametrize("number", [1, 3])
def test_a_full_disk_leaves_the_newest_in_force_and_no_older_one(stored, draft, monkeypatch, number):
    newer, calls, synced = made_after(draft, days=1), 0, os.fsync
    stored.add_calibration(newer, {})

    def full(descriptor):
        nonlocal calls
        calls += 1
        if calls == number:  # a mark's content, and then its name
            raise OSError(errno.ENOSPC, "No space left on device")
        synced(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CalibrationError, match="No space left on device; free space there"):
        stored.mark_gel_changed("T0001", GEL_CHANGE)
    assert stored.current("T0001") == newer
    stored.mark_gel_changed("T0001", GEL_CHANGE)
    assert stored.current("T0001") is None
