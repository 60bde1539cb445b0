"""Preflight checks, before anything is changed."""

import importlib.util
import os
import shutil
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

from installer import backup
from installer.layout import Layout
from installer.messages import Failed, Refused
from installer.programs import station

QUIET = timedelta(minutes=10)
_HOMES = {"root", "home"}
"""Folders of `/` that the unit's ProtectHome hides from the station."""
_PROGRAMS = {"runuser": "util-linux", "systemctl": "systemd", "systemd-sysusers": "systemd", "userdel": "passwd"}


def check_machine(layout: Layout) -> None:
    """Check this user, this Python and these programs.

    Raises:
        Refused: one of them is not suitable.
    """
    if layout.is_system and os.geteuid() != 0:
        raise Refused("only root may install below /: sudo deploy/install (or --root DIR for a trial)")
    if not layout.root.is_dir():
        raise Refused(f"--root {layout.root} is no folder: make it first")
    if importlib.util.find_spec("ensurepip") is None:
        raise Refused("this Python cannot make virtual environments: apt-get install python3-venv")
    missing = {package for program, package in _PROGRAMS.items() if layout.is_system and not shutil.which(program)}
    if missing:
        raise Refused(f"programs are missing: apt-get install {' '.join(sorted(missing))}")
    for path in (Path(sys.executable), Path(sys.executable).resolve(), Path(sys.base_prefix).resolve()):
        if layout.is_system and path.parts[1] in _HOMES:
            raise Refused(
                f"the station's user cannot run {path}: it is in a person's home. Install Python elsewhere, as "
                "deploy/install says for Debian 13, and name it: PYTHON=/opt/python/.../bin/python3.12 deploy/install"
            )


def check_disk_space(layout: Layout, release_bytes: int, *, migrates: bool) -> None:
    """Check that the disks have room for a release, for a backup of the records, and for their migration.

    Args:
        release_bytes: 0 where the release is made already.
        migrates: whether the release brings the records to another schema: it refuses to without room for two copies
            of the database, and its rollback needs room for the records as they were.

    Raises:
        Refused: they do not.
    """
    records = layout.home / backup.RECORDS
    kept = [path for path in records.rglob("*") if path.is_file() and "aside" not in path.parts]
    records_bytes = sum(file.stat().st_size for file in kept)
    wanted = [(layout.program, release_bytes), (layout.backups, records_bytes)]
    if migrates:  # and a rollback restores the records beside those that were migrated
        wanted.append((records, 2 * (records / backup.DATABASE).stat().st_size + records_bytes))
    disks: dict[int, tuple[Path, int]] = {}
    for path, size_bytes in wanted:
        place = next(parent for parent in (path, *path.parents) if parent.is_dir())
        disk = place.stat().st_dev
        disks[disk] = (place, disks.get(disk, (place, 0))[1] + size_bytes)
    for place, size_bytes in disks.values():
        free = shutil.disk_usage(place).free
        if free < size_bytes:
            raise Refused(
                f"{place} has {free / 1e6:.0f} MB of free space, {size_bytes / 1e6:.0f} MB are needed for the program, "
                "a copy of the records and their migration: free space, or mount another disk at /var/backups"
            )


def check_no_lot(layout: Layout, release: Path) -> None:
    """Check by the records that no lot is in progress; the release in use reads them.

    Raises:
        Refused: a lot is open, or a fruit was inspected within the last minutes.
    """
    if not (layout.home / backup.RECORDS / backup.DATABASE).exists():
        return
    try:
        lots = station(layout, release, "records", "lot", "list").splitlines()
        since = (datetime.now(UTC) - QUIET).isoformat(timespec="seconds")
        lately = station(layout, release, "records", "list", "--last", "1", "--from", since).splitlines()
    except Failed as error:
        raise Refused(
            f"the records do not show whether a lot is under way; --during-lot skips this check: {error}"
        ) from error
    if running := [line.split(":")[0] for line in lots if line.endswith(", runs")]:
        raise Refused(
            f"the lot {running[0]} is under way: end it first (station records lot end {running[0]}), "
            "or upgrade all the same with --during-lot"
        )
    if len(lately) > 1:  # below the table's head
        raise Refused(
            f"fruit was inspected within the last {QUIET.total_seconds() / 60:.0f} minutes: stop the line and wait, "
            "or upgrade all the same with --during-lot"
        )
