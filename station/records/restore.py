"""Restore of a backup; the present records are moved aside, never removed."""

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from sqlalchemy import delete

from station.atomic_file import sync_file, sync_folder
from station.messages import records as messages
from station.records.audit import append_restored, newer_head
from station.records.audit_head import Head, read_head, try_save_head
from station.records.backup import Manifest, copy_image, hash_of, integrity, open_regular, read_manifest
from station.records.database import FILE_NAME, move_aside, new_aside, open_engine
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, DiskFullError, RecordsError
from station.records.high_water_mark import MARK_NAME, HighWaterMark
from station.records.images import FOLDER_NAME, image_path
from station.records.migration import migrate
from station.records.open import BELONGING, RESTORING, lock_folder
from station.records.origin import begin_origin
from station.records.retention import forget_missing, referred
from station.records.schema import inspections
from station.records.schema_check import check_schema
from station.records.signing import PublicKeys


class RestoreResult(NamedTuple):
    """Result of a restore."""

    inspections: int
    images: int
    aside: Path | None
    """Folder of the previous records."""


def restore_backup(
    folder: Path, directory: Path, by: str, keys: PublicKeys | None, reserve_bytes: int = 0
) -> RestoreResult:
    """Restore a backup, all of it or nothing. Numbers given since it was made are not given again.

    All is copied and verified first, beside the records; then the present records are moved aside and the copy replaces
    them, the database last. After an interruption call it again.

    Args:
        keys: of stations, of which one has to have signed the backup; None for a backup without a known signature.
        reserve_bytes: left free on the records' disk.

    Raises:
        RecordsError: a station runs, the backup is not complete or not signed, there is no space, or the disk failed;
            the records are unchanged.
    """
    manifest = read_manifest(directory, keys)
    lock = lock_folder(folder)
    new = folder / RESTORING
    try:
        shutil.rmtree(new, ignore_errors=True)
        _check_room(folder, manifest, reserve_bytes)
        try:
            (new / FOLDER_NAME).mkdir(parents=True)
            _copied(directory, new, manifest)
            mark = HighWaterMark(folder / MARK_NAME)
            mark.value = max(mark.value, manifest.sequence)
            mark.save()
            head = _continue(folder, new, manifest, by)
        except BaseException:  # half a copy would take the space that the present records need
            shutil.rmtree(new, ignore_errors=True)
            raise
        present = [name for name in BELONGING if (folder / name).exists()]
        aside = new_aside(folder) if present else None
        if aside is not None:
            move_aside(folder, aside, *present)
        for name in (FOLDER_NAME, FILE_NAME):
            (new / name).rename(folder / name)
        sync_folder(folder)
        if head is not None:  # not before: the present records never had it, and an interruption leaves them
            try_save_head(folder, head)
        shutil.rmtree(new)
    except (OSError, sqlite3.Error) as error:
        raise map_error(error, str(folder)) from error
    finally:
        os.close(lock)
    return RestoreResult(manifest.inspections, manifest.images, aside)


def _check_room(folder: Path, manifest: Manifest, reserve_bytes: int) -> None:
    free, wanted = shutil.disk_usage(folder).free, manifest.size_bytes + reserve_bytes
    if free < wanted:
        raise DiskFullError(
            messages.NO_SPACE_FOR_BACKUP(path=str(folder), free=free, wanted=wanted), messages.FREE_SPACE()
        )


def _copied(directory: Path, new: Path, manifest: Manifest) -> None:
    """Copy database and images, each verified against the manifest."""
    source, path = directory / FILE_NAME, new / FILE_NAME
    try:
        with open_regular(source, manifest.size_bytes) as file, path.open("wb") as copy:
            shutil.copyfileobj(file, copy)
    except FileNotFoundError:
        path.unlink(missing_ok=True)
    if not path.exists() or hash_of(path) != manifest.database_sha256:
        raise DamagedError(messages.NOT_THE_VERIFIED(path=str(source)), messages.TAKE_ANOTHER())
    with closing(sqlite3.connect(path)) as connection:
        faults = check_schema(connection) or list(integrity(connection))
    if faults:
        raise DamagedError(messages.BAD_FILE(path=str(source), words=faults[0]), messages.TAKE_ANOTHER())
    with open_engine(path, "rw").connect() as connection:
        wanted = referred(connection)
    for sha256 in wanted.keys() - set(manifest.missing):
        try:
            copy_image(Path(image_path(directory, sha256)), Path(image_path(new, sha256)), sha256, wanted[sha256])
        except FileNotFoundError:
            raise DamagedError(
                messages.IMAGE_MISSING(path=str(directory), image=sha256), messages.TAKE_ANOTHER()
            ) from None
    for subfolder in (new / FOLDER_NAME, *(new / FOLDER_NAME).iterdir()):
        sync_folder(subfolder)


def _continue(folder: Path, new: Path, manifest: Manifest, by: str) -> Head | None:
    """Continue what is numbered: the outbox under a new origin, the audit trail with a row of the restore.

    Returns:
        The trail's head from then on.
    """
    engine = open_engine(new / FILE_NAME, "rw")
    try:
        migrate(engine, new)
        with engine.begin() as connection:
            begin_origin(connection)
            told = {"made_utc_ms": manifest.made_utc_ms, "inspections": manifest.inspections}
            append_restored(connection, by, read_head(folder), told)
            # What ran when the backup was made has ended since: its outcome is not in the backup, and a start would
            # give it another one. The next inspection's row of skipped numbers names it.
            connection.execute(delete(inspections).where(inspections.c.outcome.is_(None)))
            if manifest.missing:
                forget_missing(connection, frozenset(manifest.missing))
            head = newer_head(connection, None)
    except RecordsError:
        raise
    except Exception as error:
        raise map_error(error, str(new / FILE_NAME)) from error
    with closing(sqlite3.connect(new / FILE_NAME)) as connection:
        connection.execute("PRAGMA journal_mode = DELETE")
    sync_file(new / FILE_NAME)
    return head
