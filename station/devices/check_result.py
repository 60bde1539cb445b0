"""Device check result: one line of `station devices check`."""

from dataclasses import dataclass
from typing import Literal

from station.messages.message import Message


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One line of `station devices check`."""

    device: str
    found: Message
    """Device and address that answered."""
    verdict: Literal["ok", "warning", "fault"]
    remedy: Message | None = None
    """None if the verdict is ok."""
