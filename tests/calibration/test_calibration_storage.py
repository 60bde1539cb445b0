"""A calibration or verification that a command stores is in force with its audit entry, or neither is there."""

import contextlib
import os
import signal
import sqlite3
from dataclasses import replace
from datetime import timedelta

import pytest

from station.calibration.model import stamp
from station.calibration.verification_procedure import VerificationResult
from station.commands import calibration_storage
from station.commands.calibration_storage import store_calibration, store_verification
from station.messages import records as messages
from station.records.audit_report import read_audit
from station.records.database import FILE_NAME, reading, records_folder
from station.records.direct_transaction import direct_transaction
from station.records.errors import DiskFullError
from station.settings.configuration import Configuration


@pytest.fixture
def new(draft):
    """Another calibration, an hour later."""
    made_at = draft.calibration.made_at + timedelta(hours=1)
    return replace(draft, calibration=draft.calibration.model_copy(update={"id": stamp(made_at)}))


@pytest.fixture
def verified(draft, verification):
    """A verification with its pictures."""
    return VerificationResult(verification, draft.reference, {})


@pytest.fixture
def home_site(tmp_path):
    """Configuration of a home folder that has records."""
    with direct_transaction(records_folder(tmp_path)):
        pass
    return Configuration.model_validate({"home": tmp_path})


def audited(home):
    """Return the actions in the audit trail."""
    with reading(records_folder(home)) as connection:
        return [row.action for row in read_audit(connection, 100)]


def test_what_the_commands_store_is_in_force_with_its_audit_entry(stored, home_site, draft, new, verified):
    store_verification(home_site, "anna", verified, draft.calibration)
    store_calibration(home_site, "anna", new)
    assert stored.last_verification(draft.calibration) == verified.verification
    assert stored.current("T0001") == new.calibration
    assert sorted(audited(home_site.home)) == ["calibration.stored", "calibration.verified"]


def test_what_the_audit_trail_cannot_have_is_not_in_force(stored, home_site, draft, new, verified, monkeypatch):
    def full(*_):
        raise DiskFullError(messages.DISK_FULL(place="records", words="x"), messages.FREE_SPACE())

    monkeypatch.setattr("station.records.direct_transaction.newer_head", full)
    with pytest.raises(DiskFullError):
        store_calibration(home_site, "anna", new)
    with pytest.raises(DiskFullError):
        store_verification(home_site, "anna", verified, draft.calibration)
    assert stored.calibrations("T0001") == (draft.calibration,)
    assert stored.verifications("T0001") == ()
    assert audited(home_site.home) == []


def test_a_calibration_that_the_audit_trail_has_is_in_force_also_after_ctrl_c(stored, home_site, new, monkeypatch):
    monkeypatch.setattr(
        "station.records.direct_transaction.try_save_head", lambda *_: os.kill(os.getpid(), signal.SIGINT)
    )
    with pytest.raises(KeyboardInterrupt):
        store_calibration(home_site, "anna", new)
    assert audited(home_site.home) == ["calibration.stored"]
    assert stored.current("T0001") == new.calibration


def test_the_station_writes_while_a_command_draws(home_site, draft, verified, monkeypatch):
    drawn = []

    def draw(*_):
        with contextlib.closing(sqlite3.connect(records_folder(home_site.home) / FILE_NAME, timeout=0)) as database:
            database.execute("BEGIN IMMEDIATE")
            database.execute("ROLLBACK")
        drawn.append(True)
        return {}

    for name in ("calibration_files", "verification_files"):
        monkeypatch.setattr(calibration_storage, name, draw)
    store_calibration(home_site, "anna", draft)
    store_verification(home_site, "anna", verified, draft.calibration)
    assert len(drawn) == 2
