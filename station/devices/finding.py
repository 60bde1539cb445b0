"""What a look at a device found."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of `station devices check`."""

    device: str
    found: str
    """What answered, and where."""
    verdict: Literal["ok", "warning", "fault"]
    remedy: str
    """What a person is to do; empty where the verdict is ok."""
