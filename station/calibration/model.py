"""Stored records of calibrations and verifications; every field is checked when they are read."""

from datetime import UTC, datetime
from typing import Annotated, Literal

from pydantic import AwareDatetime, BaseModel, BeforeValidator, ConfigDict, Field

from station.messages import calibration as messages
from station.messages.message import Message, verbatim

Serial = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,64}$")]
"""A unit's serial number; it names a folder."""
Stamp = Annotated[str, Field(pattern=r"^\d{8}T\d{6}Z$")]
"""A calibration's or verification's name: its time, UTC."""
Levels = tuple[float, float, float]
"""Grey levels of blue, green and red."""
Positive = Annotated[float, Field(gt=0.0)]
Text = Annotated[Message, BeforeValidator(lambda value: verbatim(value) if isinstance(value, str) else value)]
"""A message; in records of versions before messages a sentence."""


class Stored(BaseModel):
    """A record that never changes; a record with unknown fields is another version's."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Check(Stored):
    """One checked property."""

    name: str
    passed: bool
    found: Text
    expected: Text
    remedy: Text
    """Remedy if it has not passed."""
    picture: str | None = None
    """The file beside the record that shows it."""


class PressPoint(Stored):
    """The ball at one width."""

    width_mm: float
    area_px: Annotated[int, Field(ge=0)]
    confidence: float | None
    cut: bool
    """The image's border cuts the contact: the area is a lower bound."""
    contrast_levels: Annotated[float, Field(ge=0.0)]
    """Change of the image by the ball, grey levels; 0 if nothing touches."""


class PlacePoint(Stored):
    """The ball at one place on the gel."""

    x_mm: float
    y_mm: float
    width_mm: float
    centroid_x_px: float
    centroid_y_px: float
    area_px: int


class FieldMap(Stored):
    """The untouched gel in coarse cells, row by row from the image's upper left."""

    rows: Annotated[int, Field(ge=1)]
    columns: Annotated[int, Field(ge=1)]
    light_levels: tuple[Levels, ...]
    """Of the reference, mean of each cell."""
    noise_levels: tuple[float, ...]
    """Standard deviation of a pixel from frame to frame, worst colour, mean of each cell."""


class Noise(Stored):
    """Noise between frames of the untouched gel."""

    pixel_levels: Levels
    """Standard deviation of a pixel from frame to frame."""
    gate: float
    """The largest value of the contact gate's statistic with nothing touching; at 1 the gate opens."""
    gate_factor: Annotated[float, Field(ge=1.0)]
    """Factor that raises this unit's gate above its noise."""
    drift_levels: float
    """The largest drift of the light against the reference, root mean square."""


class Run(Stored):
    """One run at the ball, with any result."""

    schema_version: Literal[1, 2] = 2
    """1: with sentences in the place of messages."""
    id: Stamp
    serial: Serial

    @property
    def made_at(self) -> datetime:
        """Return its time, UTC."""
        return time_of(self.id)


class Calibration(Run):
    """One unit's calibration."""

    unit: str
    """The camera's name."""
    operator: str
    simulated: bool
    program: str
    """The program version that made it."""
    ball_mm: Positive
    holder_mm: float
    width_px: Annotated[int, Field(ge=1)]
    height_px: Annotated[int, Field(ge=1)]
    mm_per_px: Positive
    scale_uncertainty: Positive
    """Relative, of a length, about two standard deviations; an area's is twice that."""
    scale_measured: bool
    """From places of the ball at known distances; else the usual scale of such sensors."""
    places: tuple[PlacePoint, ...]
    curve: tuple[PressPoint, ...]
    onset_mm: float
    """The width at which the contact begins, to one count of the gripper."""
    zero_mm: float
    """The onset minus ball and holder: about the error of the gripper's zero."""
    noise: Noise
    light_levels: Levels
    sharpness_levels: float
    field: FieldMap
    checks: tuple[Check, ...]

    @property
    def area_uncertainty(self) -> float:
        """Return the relative uncertainty of an area in mm²."""
        return 2 * self.scale_uncertainty

    def summary(self) -> Message:
        """Describe it in one line, for records and reports."""
        summary = messages.SUMMARY_MEASURED if self.scale_measured else messages.SUMMARY_USUAL
        return summary(calibration=self.id, scale_mm=self.mm_per_px, percent=100 * self.scale_uncertainty)


class Verification(Run):
    """One verification of a unit against its calibration."""

    calibration: Stamp
    operator: str
    passed: bool
    area_ratio: float | None
    """Median ratio of the ball's area to the calibration's at the same widths; None if nothing was touched."""
    onset_mm: float | None
    checks: tuple[Check, ...]
    curve: tuple[PressPoint, ...]

    @property
    def drift(self) -> float | None:
        """Return the relative change of the ball's area since the calibration."""
        return None if self.area_ratio is None else self.area_ratio - 1.0


class GelChange(Stored):
    """Change of a unit's gel: the calibrations before it are those of another gel."""

    operator: str
    changed_at: AwareDatetime
    """UTC, for a reader alone: which calibrations it takes out of force does not depend on a clock."""

    def words(self) -> Message:
        """Describe it, with the remedy, until the present gel is calibrated."""
        return messages.GEL_CHANGED(at=f"{self.changed_at:%Y-%m-%d %H:%M} UTC", operator=self.operator)


class Refusal(Run):
    """Measurements that are no valid calibration."""

    unit: str
    operator: str
    reasons: tuple[Text, ...]
    """Each with the remedy."""
    checks: tuple[Check, ...]
    """Empty if the run ended before the checks."""
    curve: tuple[PressPoint, ...]
    """The steps until the run ended."""


def stamp(at: datetime) -> str:
    """Return a record's name from its time, which has a time zone."""
    return at.astimezone(UTC).strftime("%Y%m%dT%H%M%SZ")


def time_of(name: str) -> datetime:
    """Return the time in a record's name, UTC."""
    return datetime.strptime(name, "%Y%m%dT%H%M%SZ").replace(tzinfo=UTC)
