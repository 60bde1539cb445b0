"""Records' data model: plain values, so that no other package's types are stored."""

import hashlib
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from station.channel.line import Outcome, OutcomeName
from station.inspection.fruit_size import FruitSize
from station.messages.message import Message
from station.settings.recipe_versions import canonical_text

ImageKind = Literal["reference", "step", "mask"]


@dataclass(frozen=True, slots=True)
class RecipeSnapshot:
    """A recipe at the time when a fruit was inspected by it."""

    name: str
    number: int
    """The PLC's number."""
    revision: str
    """Empty if recipes have no revisions."""
    text: str
    """The whole recipe as canonical JSON."""

    @classmethod
    def of(cls, values: Mapping[str, Any], revision: str = "") -> "RecipeSnapshot":
        """Make a snapshot of a recipe's values, as `Recipe.model_dump(mode="json")` gives them, and its revision."""
        return cls(values["name"], values["plc_number"], revision, canonical_text(values))

    @property
    def sha256(self) -> str:
        """Return the text's SHA-256, hexadecimal: the snapshot's key."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def checksum(self) -> int:
        """Return the text's CRC-32: the PLC reads it."""
        return zlib.crc32(self.text.encode())


@dataclass(frozen=True, slots=True)
class Trigger:
    """Data known when an inspection begins."""

    trigger_id: int
    encoder: int
    lot: str
    began_utc_ms: int
    recipe: RecipeSnapshot | None
    simulated: bool
    fruit_length_mm_x10: int = 0
    """As the PLC wrote it, tenths of a millimetre, also if impossible; 0 if it gave none, and in older records."""
    size_class: int = 0
    """Likewise."""

    @property
    def size(self) -> FruitSize:
        """Return the same in mm; None for a size that was not given."""
        return FruitSize(self.fruit_length_mm_x10 / 10 or None, self.size_class or None)


@dataclass(frozen=True, slots=True)
class CurvePoint:
    """One width step."""

    step: int
    """From 0, the start."""
    width_mm: float
    """Measured."""
    closing_mm: float | None
    """None before the onset is known."""
    area_mm2: float | None
    """None if nothing valid was measured."""
    area_px: int | None
    confidence: float | None
    flags: tuple[str, ...] = ()
    captured_s: float | None = None
    """Time since the inspection began, by the monotonic clock."""
    changed_area_mm2: float | None = None
    """Changed area of the image; None in older records, and if the method does not measure it."""
    changed_area_px: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An image that may be stored."""

    kind: ImageKind
    step: int | None
    """The width step; None for the reference."""
    pixels: npt.NDArray[np.uint8]
    """`(height, width)` or `(height, width, 3)` in OpenCV's order, blue first. Must not be changed any more."""


@dataclass(frozen=True, slots=True)
class InspectionRecord:
    """Result of an inspection."""

    outcome: OutcomeName
    reasons: tuple[str, ...]
    """The first one decided; empty only for PASS."""
    explanation: tuple[Message, ...]
    late: bool
    partial: bool
    area_mm2: float | None
    area_px: int | None
    closing_mm: float | None
    confidence: float | None
    ended_utc_ms: int
    duration_ms: int
    """By the monotonic clock."""
    curve: tuple[CurvePoint, ...] = ()
    phases_s: Mapping[str, float] = field(default_factory=dict)
    """Duration of each phase of the cycle, by the monotonic clock."""
    measures: Mapping[str, float | int | str | bool | None] = field(default_factory=dict)
    """Values that the judge used beside the area."""
    judgement: Message | None = None
    """The area with its uncertainty and its limit; None if one of them is not known."""
    first_press_findings: Message | None = None
    """Why the first press did not decide; None if the fruit was pressed once."""
    devices: Mapping[str, str] = field(default_factory=dict)
    """Names of the devices."""
    versions: Mapping[str, str] = field(default_factory=dict)
    images: tuple[Image, ...] = ()
    """Candidates: the records decide whether they are stored."""


@dataclass(frozen=True, slots=True)
class OpenInspections:
    """Inspections that began and were not acknowledged, in order of sequence."""

    running: tuple[tuple[int, int], ...]
    """Sequence and trigger id."""
    ended: tuple[Outcome, ...]
    """The published outcome if there is one, else the one to be published."""


@dataclass(frozen=True, slots=True)
class StoredAlarm:
    """An alarm that is not in its normal state, as stored for the next start."""

    id: str
    state: str
    raised_utc_ms: int
    changed_utc_ms: int
    detail: str = ""
    shelved_until_utc_ms: int | None = None
    shelved_by: str = ""


@dataclass(frozen=True, slots=True)
class AlarmEntry:
    """One line of the alarms' log."""

    utc_ms: int
    id: str
    change: str
    """As `raised`, `acknowledged`, `cleared`, `shelved`."""
    detail: str = ""
    sequence: int | None = None


@dataclass(frozen=True, slots=True)
class StoredImage:
    """A stored image."""

    kind: ImageKind
    step: int | None
    sha256: str
    size_bytes: int
    path: str
    """Of the PNG file; absolute."""


@dataclass(frozen=True, slots=True)
class FullRecord:
    """All stored data of one inspection."""

    sequence: int
    trigger: Trigger
    boot: str
    """The start of the station in which it began."""
    judged: InspectionRecord | None
    """As given to `conclude`, without images; None if the station was lost before."""
    standing: Outcome | None
    """The outcome published to the PLC, or to be published; None while it runs."""
    published_utc_ms: int | None
    acknowledged_utc_ms: int | None
    images: tuple[StoredImage, ...]
    images_state: Message | None
    """Whether its images are stored, or why not; None of one that runs."""
