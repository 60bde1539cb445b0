"""How the outbox does, in a small file that the station's metrics are made from."""

import json
import os
import time
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

FOLDER_NAME = "outbox"
_FILE_NAME = "status.json"


class DestinationStatus(BaseModel):
    """Of one destination."""

    model_config = ConfigDict(frozen=True, strict=True)
    connected: bool
    told: int
    """Events since the process began."""
    refused: int
    waiting: int | None
    """Entries that it has not been told; None before the first connection."""
    oldest_utc_ms: int | None
    """When the first of them was done."""
    error: str
    """Why it cannot be told now; empty where it can."""
    away_since_utc_ms: int | None = None
    """Since when it cannot."""


class OutboxStatus(BaseModel):
    """Of all."""

    model_config = ConfigDict(frozen=True, strict=True)
    utc_ms: int
    destinations: dict[str, DestinationStatus]


def outbox_folder(home: Path) -> Path:
    """Where the outbox keeps its few files.

    Args:
        home: the station's home folder.
    """
    return home / FOLDER_NAME


def write_status(folder: Path, destinations: dict[str, DestinationStatus]) -> None:
    """Say how it does.

    Args:
        folder: the outbox's.
        destinations: by name.

    Raises:
        OSError: it cannot be written.
    """
    status = OutboxStatus(utc_ms=time.time_ns() // 1_000_000, destinations=destinations)
    write_whole(folder / _FILE_NAME, status.model_dump_json())


def read_status(folder: Path) -> OutboxStatus | None:
    """What it said last; None where it never did, or not so that it can be read.

    Args:
        folder: the outbox's.
    """
    try:
        return OutboxStatus.model_validate(json.loads((folder / _FILE_NAME).read_bytes()))
    except (OSError, ValueError, ValidationError):
        return None


def write_whole(path: Path, text: str) -> None:
    """Put a file in the place of the one there, whole or not at all.

    Args:
        path: in a folder that is made where missing.
        text: its content.

    Raises:
        OSError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    with partial.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
