"""Rollback to the release before the last upgrade, with data that this release can read."""

import json
import shutil
import sqlite3
from pathlib import Path

from installer import backup, site_files
from installer.health import LIMIT_S, wait_until_healthy
from installer.layout import NAME, Layout, point, read_note, target
from installer.messages import Failed, Refused, print_progress
from installer.programs import LONG_S, own, station
from installer.release import STAMP, complete
from installer.services import Services


def check(layout: Layout) -> None:
    """Check that there is a release to roll back to, and that it can read the records, or has room to restore them.

    Raises:
        Refused: there is none, or it cannot, or the backup that it needs is gone.
    """
    old, note = target(layout.previous), read_note(layout.upgrade)
    if old is None or not complete(old) or not note:
        raise Refused("there is no upgrade to take back: only the last one can be, and only once")
    copy = layout.backups / str(note["copy"])
    if not copy.is_dir() and note.get("schema") != _schema(layout.home / backup.RECORDS):
        raise Refused(
            f"{copy} is gone, and {old.name} cannot read the records as they are: put this backup back to its place"
        )
    if _restores(layout, copy):
        size_bytes = read_note(copy / backup.RECORDS / "backup.json").get("size_bytes", 0)
        needed, free = size_bytes + _reserve_bytes(layout), shutil.disk_usage(layout.home).free
        if free < needed:
            raise Refused(
                f"{layout.home} has {free / 1e6:.0f} MB of free space, {needed / 1e6:.0f} MB are needed to restore the "
                f"records that {old.name} can read: free space"
            )


def roll_back(layout: Layout, services: Services, limit_s: float = LIMIT_S) -> None:
    """Roll the last upgrade back. An interrupted rollback is completed by another call.

    The configuration is restored if the upgrade had changed it; the records only if the old release cannot read them,
    and the inspections since the upgrade are then in their folder `aside`.

    Raises:
        Refused: there is no upgrade to roll back.
        Failed: a step failed.
    """
    check(layout)
    old, note = target(layout.previous), read_note(layout.upgrade)
    assert old is not None  # noqa: S101 (checked)
    print_progress(f"back to {old.name}")
    services.stop()
    copy = layout.backups / str(note["copy"])
    before = note["configuration"]
    if before is not None and layout.configuration.read_text(encoding="utf-8") != before:  # not yet, by an earlier call
        shutil.copyfile(
            layout.configuration, layout.configuration.with_name(f"{layout.configuration.name}.rolled-back")
        )
        layout.configuration.write_text(before, encoding="utf-8")
        own(layout, layout.configuration, "root", NAME)
        print_progress(f"{layout.configuration} is as before the upgrade")
    if _restores(layout, copy):
        station(layout, old, "records", "restore", copy / backup.RECORDS, limit_s=LONG_S)
        print_progress(
            f"the records are as before the upgrade; what came since is in {layout.home / backup.RECORDS / 'aside'}"
        )
    site_files.put(layout, old)
    point(layout.current, old)
    services.reload()
    services.enable()
    if services.start():
        version = str(read_note(old / STAMP)["version"])
        wait_until_healthy(layout, old, version, was_ready=False, needs_records=False, limit_s=limit_s)
    layout.upgrade.unlink()
    layout.previous.unlink()
    print_progress(f"{old.name} is in use again")


def _restores(layout: Layout, copy: Path) -> bool:
    """Return whether the old release needs the records of its backup: those in use have another schema."""
    records, old = layout.home / backup.RECORDS, copy / backup.RECORDS
    return old.is_dir() and _schema(records) != backup.schema_version(old)


def _schema(records: Path) -> str | None:
    """Return the schema of the records in use; None where they cannot be read as they are."""
    try:
        return backup.schema_version(records)
    except sqlite3.Error:
        return None


def _reserve_bytes(layout: Layout) -> int:
    """Return what a restore leaves free; 0 where the release in use cannot read its configuration."""
    try:
        return 1_000_000 * json.loads(station(layout, layout.current, "config", "show"))["records"]["free_reserve_mb"]
    except Failed:
        return 0
