"""Backup of everything that a site cannot recreate: records, state and configuration."""

import contextlib
import fcntl
import itertools
import os
import shutil
import sqlite3
import sys
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from installer.layout import NAME, Layout, read_note
from installer.messages import Failed, print_progress
from installer.programs import LONG_S, run, station

LAST_BACKUP = "last_backup"
"""An empty file of the home folder; its time is that of the last complete backup, which the station exports."""
_OF_THE_CELL = frozenset({"held_for_a_person", "stopped_by_a_person", "mode", "plc", "active_recipe.json", "named_lot"})
"""Whether a fruit is held, a person has stopped the station or works in the cell, what is open with the PLC, and which
recipe and lot run."""
LEFT_OUT = frozenset({"records", "run", "panel_jobs", "logs", "lost+found", LAST_BACKUP}) | _OF_THE_CELL
"""Of the home folder: the records are copied by the station itself, the rest is of the moment.

A restore must not replace what is so now in the cell by what was so when the backup was made.
"""
RECORDS, STATE, SETTINGS = "records", "state", "settings"
DAILY, BEFORE_UPGRADE = "daily-", "before-upgrade-"
"""The kinds of a backup: the first part of its folder's name."""
DATABASE = Path("records.sqlite3")
COPIED_TO = "copied to "
"""Beginning of what the program `backup` says of a complete backup."""


def make_backup_as_user(layout: Layout, release: Path, kind: str, keep: int) -> Path:
    """Run a release's program `backup`, which goes on as the station's user, and return the backup's folder.

    Raises:
        Failed: as for `make_backup`.
    """
    program = (release / "venv" / "bin" / "python", "-B", release / "deploy" / "backup")
    options = ("--root", layout.root, "--kind", kind, "--keep", str(keep))
    output = run(*program, *options, environment=layout.environment(), limit_s=2 * LONG_S)
    sys.stdout.write(output)
    return layout.backups / Path(output.partition(COPIED_TO)[2].splitlines()[0]).name


def make_backup(layout: Layout, release: Path, kind: str) -> Path:
    """Back up records, state and configuration into a new folder, as the station's user; the station may run meanwhile.

    Another backup that is being made is awaited: each removes what an interrupted one has left.

    Args:
        release: its program backs up the records.
        kind: the first part of the folder's name.

    Returns:
        The folder. It has this name only when it is complete.

    Raises:
        Failed: the records could not be copied, for example because the disk is full, or a file cannot be read.
    """
    with _alone(layout):
        return _make_backup(layout, release, kind)


def _make_backup(layout: Layout, release: Path, kind: str) -> Path:
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ")
    names = (f"{kind}{stamp}{'' if number == 1 else f'-{number}'}" for number in itertools.count(1))
    copy = next(path for name in names if not (path := layout.backups / name).exists())
    partial = layout.backups / f".{copy.name}.partial"
    for left in layout.backups.glob(".*.partial"):
        shutil.rmtree(left, ignore_errors=True)
    partial.mkdir(mode=0o750)
    has_records = (layout.home / RECORDS / DATABASE).exists()
    if has_records:
        station(layout, release, "records", "backup", partial / RECORDS, limit_s=LONG_S)
    kept = [path.name for path in layout.home.iterdir() if path.name not in LEFT_OUT] if layout.home.is_dir() else []
    for name in kept:
        _copied(layout.home / name, partial / STATE / name)
    _copied(layout.settings, partial / SETTINGS)
    if has_records and not (partial / RECORDS / DATABASE).exists():
        raise Failed(f"{partial} has no records, so there is no backup: somebody removed them; make another")
    os.sync()  # else a power failure could leave the name on the disk and not the files
    partial.rename(copy)
    backups = os.open(layout.backups, os.O_RDONLY)
    try:
        os.fsync(backups)
    finally:
        os.close(backups)
    (layout.home / LAST_BACKUP).unlink(missing_ok=True)
    (layout.home / LAST_BACKUP).touch(exist_ok=False)
    return copy


def prune(layout: Layout, kind: str, keep: int, made: Path) -> None:
    """Remove the backups of a kind, as for `make_backup`, but for so many newest ones, of which `made` is one.

    Their age is that of the records in them, by the highest number given: a clock that was set back makes names that
    sort before older ones. Numbers never go down, so those with a higher one than `made` are of records before a new
    beginning, and are the oldest.
    """
    with _alone(layout):
        last = _sequence(made)
        others = [path for path in layout.backups.glob(f"{kind}*") if path.is_dir() and path != made]
        others.sort(key=lambda path: ((number := _sequence(path)) <= last, number, path.name))
        for path in others[: max(0, len(others) + 1 - keep)]:
            try:
                shutil.rmtree(path)
            except OSError as error:  # the new backup is complete all the same
                print_progress(f"{path} cannot be removed ({error.strerror}): remove it as root")
            else:
                print_progress(f"removed {path}, which was older than the last {keep}")


@contextlib.contextmanager
def _alone(layout: Layout) -> Iterator[None]:
    """Wait until no other backup is made or removed: an upgrade's and the daily one may meet."""
    home = os.open(layout.home, os.O_RDONLY)  # the backups may be on a network disk, whose folders cannot be locked
    try:
        try:
            fcntl.flock(home, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print_progress("another backup is being made: this one begins after it")
            fcntl.flock(home, fcntl.LOCK_EX)
        yield
    finally:
        os.close(home)


def _sequence(copy: Path) -> int:
    """Return the highest number given to an inspection when a backup was made; -1 where it has no records."""
    return read_note(copy / RECORDS / "backup.json").get("sequence", -1)


def schema_version(folder: Path) -> str:
    """Return a records' or backup's schema version, as its migrations name it; empty for none."""
    if not (folder / DATABASE).exists():
        return ""
    with contextlib.closing(sqlite3.connect(folder / DATABASE)) as connection:
        row = connection.execute("SELECT version_num FROM alembic_version").fetchone()
    return str(row[0]) if row else ""


def _copied(path: Path, to: Path) -> None:
    to.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        shutil.copytree(path, to, symlinks=True, copy_function=_copied_file)
    elif path.is_file():
        _copied_file(path, to)


def _copied_file(path: Path | str, to: Path | str) -> None:
    """Copy a file, unless it has been removed meanwhile: the station writes files under temporary names.

    Raises:
        Failed: this user may not read it.
    """
    try:
        shutil.copy2(path, to)
    except FileNotFoundError:
        return
    except PermissionError as error:
        raise Failed(
            f"{error.filename} cannot be read, so there is no backup: let the group {NAME} read it (chgrp, chmod g+r), "
            "or keep it elsewhere"
        ) from error
