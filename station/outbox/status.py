"""Outbox status, in a small file that the station's metrics are made from."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from station.atomic_file import write_atomically
from station.clock import utc_ms
from station.messages.message import Message

FOLDER_NAME = "outbox"
_FILE_NAME = "status.json"


class DestinationStatus(BaseModel):
    """Status of one destination."""

    model_config = ConfigDict(frozen=True, strict=True)
    connected: bool
    told: int
    """Events published since the process started."""
    refused: int
    waiting: int | None
    """Entries not published to it yet; None before the first connection."""
    oldest_utc_ms: int | None
    """Time of the first of them."""
    error: Message | None
    """Its fault now."""
    away_since_utc_ms: int | None = None
    """Start of the fault."""

    @property
    def waiting_since_utc_ms(self) -> int | None:
        """Time since which something may wait: of the first entry, or of the fault while that is not known."""
        return self.away_since_utc_ms if self.waiting is None else self.oldest_utc_ms


class OutboxStatus(BaseModel):
    """Status of all destinations."""

    model_config = ConfigDict(frozen=True, strict=True)
    utc_ms: int
    destinations: dict[str, DestinationStatus]

    @property
    def age_s(self) -> float:
        """Time since it was written, s; one from the future is of a clock that was set back since, and as old."""
        return abs(utc_ms() - self.utc_ms) / 1000


def outbox_folder(home: Path) -> Path:
    """Return the folder of the outbox's files."""
    return home / FOLDER_NAME


def write_status(folder: Path, destinations: dict[str, DestinationStatus]) -> None:
    """Write the status.

    Raises:
        OSError: it cannot be written.
    """
    status = OutboxStatus(utc_ms=utc_ms(), destinations=destinations)
    folder.mkdir(parents=True, exist_ok=True)
    write_atomically(folder / _FILE_NAME, status.model_dump_json().encode())


def read_status(folder: Path) -> OutboxStatus | None:
    """Read the last status; None if there is none that can be read."""
    try:
        return OutboxStatus.model_validate_json((folder / _FILE_NAME).read_bytes())
    except (OSError, ValidationError):
        return None
