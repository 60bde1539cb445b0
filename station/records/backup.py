"""Backup of the records, made while the station writes, verified, and visible only when it is complete."""

import hashlib
import os
import shutil
import sqlite3
import stat
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import BinaryIO

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from station.atomic_file import sync_file, sync_folder
from station.clock import utc_ms
from station.messages import records as messages
from station.records.audit import has_row, newer_head
from station.records.audit_head import Head, read_head, signed_head
from station.records.database import FILE_NAME, open_engine, plain, reading
from station.records.error_mapping import map_error
from station.records.errors import DamagedError, DiskFullError, RecordsError
from station.records.high_water_mark import LARGEST, MARK_NAME, HighWaterMark
from station.records.images import FOLDER_NAME, image_path
from station.records.retention import referred
from station.records.schema_check import check_schema
from station.records.signing import PublicKeys, is_signed, name_of, sign

MANIFEST_NAME = "backup.json"
SIGNATURE_NAME = "backup.sig"
"""The station's Ed25519 signature of the manifest's bytes: 64 bytes, as `openssl pkeyutl -verify -rawin` reads them."""
_PARTIAL = ".partial"
_LONGEST_MANIFEST_BYTES, _LONGEST_SIGNATURE_BYTES = 1 << 26, 64


class Manifest(BaseModel):
    """Contents of a backup, to be checked before it is used."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    form: int = 1
    made_utc_ms: int = Field(ge=0)
    sequence: int = Field(ge=0, le=LARGEST)
    """The highest sequence number given when the backup was made."""
    inspections: int = Field(ge=0)
    """With an outcome: a restore leaves out one that ran."""
    images: int = Field(ge=0)
    size_bytes: int = Field(ge=0)
    database_sha256: str = Field(pattern="^[0-9a-f]{64}$")
    audit_head: str = Field(default="", pattern="^([0-9]+:[0-9a-f]{64}(:[0-9A-Za-z_-]{86})?)?$")
    """The audit trail's last row, signed: an anchor for `station audit verify`; empty if there is none."""
    missing: tuple[str, ...] = ()
    """SHA-256 of images that the database refers to and that could not be copied; a restore records them as lost."""
    notes: tuple[str, ...] = ()
    """Images that could not be copied, or were missing before."""


def make_backup(folder: Path, directory: Path, reserve_bytes: int = 0) -> Manifest:
    """Copy database and images. The database is a snapshot of one moment; the station does not wait.

    Args:
        directory: must not exist; it is `.NAME.partial` beside it until it is complete.
        reserve_bytes: left free where the backup is on the records' own disk.

    Raises:
        RecordsError: it exists, there is no space, or the disk failed; then no `directory` is left.
    """
    if os.path.lexists(directory):
        raise RecordsError(messages.THERE_ALREADY(path=str(directory)), messages.NEW_FOLDER())
    partial = directory.with_name(f".{directory.name}{_PARTIAL}")
    try:
        _remove(partial)
        _room(folder, directory.parent, reserve_bytes)
        (partial / FOLDER_NAME).mkdir(parents=True)
        manifest = _copied(folder, partial)
        content = manifest.model_dump_json(indent=1).encode()
        for name, data in ((MANIFEST_NAME, content), (SIGNATURE_NAME, sign(folder, content))):
            (partial / name).write_bytes(data)
            sync_file(partial / name)
        sync_folder(partial)
        partial.rename(directory)
        sync_folder(directory.parent)
    except RecordsError:
        _remove(partial)
        raise
    except (OSError, sqlite3.Error) as error:
        _remove(partial)
        raise map_error(error, str(directory)) from error
    return manifest


def read_manifest(directory: Path, keys: PublicKeys | None) -> Manifest:
    """Read a backup's manifest, and check that a station signed it.

    Args:
        keys: of which one has to have signed it; None for a backup that is used without a signature.

    Raises:
        RecordsError: it is no backup, an incomplete one, or not signed by one of the keys.
    """
    try:
        content = _read(directory / MANIFEST_NAME, _LONGEST_MANIFEST_BYTES)
        if keys is not None:
            _check_signature(directory, content, keys)
        return Manifest.model_validate_json(content)
    except FileNotFoundError:
        raise RecordsError(
            messages.NO_BACKUP(path=str(directory), file=MANIFEST_NAME), messages.NAME_BACKUP()
        ) from None
    except ValidationError as error:
        raise DamagedError(
            messages.BAD_FILE(path=str(directory / MANIFEST_NAME), words=error.errors()[0]["msg"]),
            messages.TAKE_ANOTHER(),
        ) from error
    except OSError as error:
        raise map_error(error, str(directory)) from error


def _check_signature(directory: Path, content: bytes, keys: PublicKeys) -> None:
    try:
        signature = _read(directory / SIGNATURE_NAME, _LONGEST_SIGNATURE_BYTES)
    except FileNotFoundError:
        raise DamagedError(messages.BACKUP_UNSIGNED(path=str(directory)), messages.TRUST_BACKUP()) from None
    if not is_signed(keys, signature, content):
        raise DamagedError(
            messages.BACKUP_OTHER_KEY(path=str(directory), keys=", ".join(map(name_of, keys)) or "-"),
            messages.TRUST_BACKUP(),
        )


def open_regular(path: Path, most_bytes: int) -> BinaryIO:
    """Open a file of a backup that may be anything, as a device that never ends.

    Raises:
        FileNotFoundError: it is missing.
        DamagedError: it is no regular file, or larger.
    """
    file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb")
    found = os.fstat(file.fileno())
    if not stat.S_ISREG(found.st_mode) or found.st_size > most_bytes:
        file.close()
        raise DamagedError(messages.NO_SUCH_FILE(path=str(path), most=most_bytes), messages.TAKE_ANOTHER())
    return file


def _read(path: Path, most_bytes: int) -> bytes:
    with open_regular(path, most_bytes) as file:
        return file.read(most_bytes)


def copy_image(source: Path, target: Path, sha256: str, size_bytes: int) -> int:
    """Copy an image, durably, if its content matches its name; return its size in bytes, of which no more is read.

    Raises:
        FileNotFoundError: it is missing.
        DamagedError: its content does not match.
    """
    content = _read(source, size_bytes)
    if hashlib.sha256(content).hexdigest() != sha256:
        raise DamagedError(messages.OTHER_CONTENT(path=str(source)), messages.PUT_BACK_BACKUP())
    target.parent.mkdir(exist_ok=True)
    target.write_bytes(content)
    sync_file(target)
    return len(content)


def hash_of(path: Path) -> str:
    """Return a file's SHA-256, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def integrity(connection: sqlite3.Connection) -> Iterator[str]:
    """Return SQLite's integrity faults of a database, up to 100."""
    try:
        for (found,) in connection.execute("PRAGMA integrity_check(100)"):
            if found != "ok":
                yield f"the database: {found}"
        for table, row, parent, _ in connection.execute("PRAGMA foreign_key_check").fetchmany(100):
            yield f"the database: row {row} of {table} refers to no row of {parent}"
    except sqlite3.Error as error:
        yield f"the database: {error}"


def _copied(folder: Path, partial: Path) -> Manifest:
    # The head is read before the copy: the row that it names has to be in it.
    path, known = partial / FILE_NAME, read_head(folder)
    with reading(folder) as live, closing(sqlite3.connect(path)) as target:
        plain(live).backup(target)  # in one step: a reader of the write-ahead log delays no other
        # The copy is one file, whose hash is signed: no write-ahead log belongs to it.
        target.execute("PRAGMA journal_mode = DELETE")
        faults = [*check_schema(target), *integrity(target)]
    if faults:
        raise DamagedError(messages.BAD_FILE(path=str(folder / FILE_NAME), words=faults[0]), messages.RUN_CHECK_KEEP())
    size_bytes, missing, notes = _copy_images(folder, partial)
    head, cut = _audit_head(folder, path, known)
    with closing(sqlite3.connect(path)) as target:
        inspections, last = target.execute("SELECT count(outcome), max(sequence) FROM inspections").fetchone()
        (referred_to,) = target.execute("SELECT count(DISTINCT sha256) FROM images").fetchone()
    sync_file(path)
    return Manifest(
        made_utc_ms=utc_ms(),
        sequence=max(HighWaterMark(folder / MARK_NAME).value, last or 0),
        inspections=inspections,
        images=referred_to - len(missing),
        size_bytes=size_bytes + path.stat().st_size,
        database_sha256=hash_of(path),
        audit_head=head,
        missing=missing,
        notes=(*notes, *cut),
    )


def _audit_head(folder: Path, path: Path, known: Head | None) -> tuple[str, tuple[str, ...]]:
    """Return the copied trail's last row, and whether it lacks rows that existed before the copy."""
    with open_engine(path, "ro").connect() as connection:
        head = newer_head(connection, None)
        cut = known is not None and not has_row(connection, known)
    note = "the audit trail lacks rows that it had: see `station audit verify`"
    return str(signed_head(folder, head)) if head else "", (note,) if cut else ()


def _copy_images(folder: Path, partial: Path) -> tuple[int, tuple[str, ...], list[str]]:
    """Copy the images that the copied database refers to; the quota may have removed some since."""
    with open_engine(partial / FILE_NAME, "ro").connect() as connection:
        wanted = referred(connection)
    size_bytes, missing, damaged = 0, list[str](), list[str]()
    for sha256, size in wanted.items():
        try:
            size_bytes += copy_image(Path(image_path(folder, sha256)), Path(image_path(partial, sha256)), sha256, size)
        except FileNotFoundError:
            missing.append(sha256)
        except DamagedError as error:
            missing.append(sha256)
            damaged.append(str(error.cause))
    for subfolder in (partial / FOLDER_NAME, *(partial / FOLDER_NAME).iterdir()):
        sync_folder(subfolder)
    gone = len(missing) - len(damaged)
    notes = [*damaged, *([f"{gone} images were removed or missing meanwhile"] if gone else [])]
    return size_bytes, tuple(missing), notes


def _room(folder: Path, place: Path, reserve_bytes: int) -> None:
    wanted = sum(file.stat().st_size for file in folder.glob(f"{FILE_NAME}*"))
    with reading(folder) as connection:
        wanted += sum(referred(connection).values())
    place.mkdir(parents=True, exist_ok=True)
    if place.stat().st_dev == folder.stat().st_dev:
        wanted += reserve_bytes
    free = shutil.disk_usage(place).free
    if free < wanted:
        raise DiskFullError(
            messages.NO_SPACE_FOR_BACKUP(path=str(place), free=free, wanted=wanted), messages.FREE_SPACE_OR_OTHER()
        )


def _remove(partial: Path) -> None:
    if partial.exists():
        shutil.rmtree(partial)
