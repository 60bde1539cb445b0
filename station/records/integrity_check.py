"""Integrity check of the records: schema, audit trail, inspections against their seals, images against their names."""

import hashlib
from pathlib import Path
from typing import NamedTuple

from sqlalchemy import func, select

from station.records.audit_check import NO_PROOF, Proof, check_trail
from station.records.backup import integrity
from station.records.database import plain, reading
from station.records.images import FOLDER_NAME, image_path
from station.records.retention import referred
from station.records.schema import inspections
from station.records.schema_check import check_schema
from station.records.seals import check_seals


class IntegrityReport(NamedTuple):
    """Result of the integrity check."""

    inspections: int
    images: int
    faults: tuple[str, ...]
    """Damaged or missing data."""
    notes: tuple[str, ...]
    """What is no fault: what is not sealed, or what the next start repairs."""


def check_records(folder: Path, proof: Proof = NO_PROOF) -> IntegrityReport:
    """Check everything, also while the station writes; changes nothing.

    Raises:
        RecordsError: there are no records, or they cannot be read at all.
        BadInputError: the folder's public key is damaged.
    """
    trail = check_trail(folder, proof)
    faults, notes = [f"the audit trail: {text}" for text in trail.broken], list(trail.notes)
    with reading(folder) as connection:
        faults += [*integrity(plain(connection)), *check_schema(plain(connection))]
        changed, unsealed = check_seals(connection)
        number = connection.scalar(select(func.count()).select_from(inspections)) or 0
        wanted = referred(connection)
    missing, damaged = [], []
    for sha256 in wanted:
        try:
            content = Path(image_path(folder, sha256)).read_bytes()
        except FileNotFoundError:
            missing.append(sha256)
        except OSError as error:
            damaged.append(f"{image_path(folder, sha256)}: {error.strerror}")
        else:
            if hashlib.sha256(content).hexdigest() != sha256:
                damaged.append(f"{image_path(folder, sha256)}: its content is not what its name says")
    files = {file.stem for file in (folder / FOLDER_NAME).glob("*/*.png")}
    with reading(folder) as connection:  # the station may have removed or added some meanwhile
        still = referred(connection)
    gone = [image_path(folder, name) for name in missing if name in still]
    faults += [*changed, *damaged, *(f"{path}: missing, though an inspection refers to it" for path in gone)]
    orphans = len(files - wanted.keys() - still.keys())
    notes += [*unsealed, *([f"{orphans} image files belong to no inspection (yet)"] if orphans else [])]
    return IntegrityReport(number, len(wanted), tuple(faults), tuple(notes))
