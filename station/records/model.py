"""What goes into the records and comes out of them: plain values, so that no other room's types are stored."""

import hashlib
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from station.channel.line import Outcome, OutcomeName
from station.inspection.fruit_size import FruitSize

ImageKind = Literal["reference", "step", "mask"]


@dataclass(frozen=True, slots=True)
class RecipeSnapshot:
    """A recipe as it was when a fruit was inspected with it."""

    name: str
    number: int
    """The PLC's number."""
    revision: str
    """Empty where recipes have none."""
    text: str
    """The whole recipe as canonical JSON."""

    @classmethod
    def of(cls, values: Mapping[str, Any], revision: str = "") -> "RecipeSnapshot":
        """Take a recipe's values, as `Recipe.model_dump(mode="json")` gives them.

        Args:
            values: with `name` and `plc_number`.
            revision: the recipe's revision, where it has one.
        """
        text = json.dumps(values, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        return cls(values["name"], values["plc_number"], revision, text)

    @property
    def sha256(self) -> str:
        """The text's SHA-256, hexadecimal: the snapshot's key."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def checksum(self) -> int:
        """The text's CRC-32: what the PLC reads."""
        return zlib.crc32(self.text.encode())


@dataclass(frozen=True, slots=True)
class Trigger:
    """What is known when an inspection begins."""

    trigger_id: int
    encoder: int
    lot: str
    began_utc_ms: int
    recipe: RecipeSnapshot | None
    simulated: bool
    fruit_length_mm_x10: int = 0
    """As the PLC wrote it, tenths of a millimetre, possible or not; 0 where it gave none, and in older records."""
    size_class: int = 0
    """Likewise."""

    @property
    def size(self) -> FruitSize:
        """The same in mm; None for what was not given."""
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
    """None where nothing valid was measured."""
    area_px: int | None
    confidence: float | None
    flags: tuple[str, ...] = ()
    captured_s: float | None = None
    """After the inspection's begin, by the monotonic clock."""
    changed_area_mm2: float | None = None
    """How much of the image has changed; None in older records, and where the method does not say."""
    changed_area_px: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An image to keep."""

    kind: ImageKind
    step: int | None
    """The width step; None for the reference."""
    pixels: npt.NDArray[np.uint8]
    """`(height, width)` or `(height, width, 3)` in OpenCV's order, blue first. Not to be changed any more."""


@dataclass(frozen=True, slots=True)
class InspectionRecord:
    """How an inspection ended."""

    outcome: OutcomeName
    reasons: tuple[str, ...]
    """The first one decided; empty only for PASS."""
    explanation: tuple[str, ...]
    """Why, in sentences."""
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
    """How long each phase of the cycle took, by the monotonic clock."""
    measures: Mapping[str, float | int | str | bool | None] = field(default_factory=dict)
    """What the judge went by beside the area."""
    devices: Mapping[str, str] = field(default_factory=dict)
    """Who took part, as each names itself."""
    versions: Mapping[str, str] = field(default_factory=dict)
    images: tuple[Image, ...] = ()
    """Candidates: the records decide whether they are kept."""


@dataclass(frozen=True, slots=True)
class OpenInspections:
    """What was begun and not acknowledged, in order of sequence."""

    running: tuple[tuple[int, int], ...]
    """Sequence and trigger id."""
    ended: tuple[Outcome, ...]
    """What was published where something was, else what is to be published."""


@dataclass(frozen=True, slots=True)
class AlarmRow:
    """An alarm that is not in its normal state, as it has to be remembered over a restart."""

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
    """An image that was kept."""

    kind: ImageKind
    step: int | None
    sha256: str
    size_bytes: int
    path: str
    """Of the PNG file; absolute."""


@dataclass(frozen=True, slots=True)
class FullRecord:
    """All that is known of one inspection."""

    sequence: int
    trigger: Trigger
    boot: str
    """The start of the station in which it began."""
    judged: InspectionRecord | None
    """As given to `conclude`, without images; None where the station was lost before."""
    standing: Outcome | None
    """What the PLC was told, or is to be told; None while it runs."""
    published_utc_ms: int | None
    acknowledged_utc_ms: int | None
    images: tuple[StoredImage, ...]
    images_state: str
    """`kept`, `not wanted`, or why there are none."""
