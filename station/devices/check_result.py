"""Device check result: one line of `station devices check`."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class CheckResult:
    """One line of `station devices check`."""

    device: str
    found: str
    """Device and address that answered."""
    verdict: Literal["ok", "warning", "fault"]
    remedy: str
    """Remedy; empty if the verdict is ok."""
