"""Reference: how the untouched gel is captured, and whether its picture may be the reference of a measurement.

The jaws are fully open, so that nothing touches the gel; the reference is the median of frames taken from then on.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.messages import grip as messages
from station.messages.message import Message
from station.press.rig import Frame, GripError, Position, Rig, Step
from station.settings.service import ReferenceSettings
from station.vision.contact import Image, Method
from station.vision.image_quality import DEAD_LED, light, saturated_share, sharpness
from station.vision.median import median_image
from station.vocabulary import Flag

_OPEN_WITHIN_MM = 2.0
"""How far short of their width jaws still count as open, mm. Estimate: a few times the 2 counts of 0.4 mm within which
the gripper counts as at its place."""

ALARMS = (AlarmId.CAMERA_SATURATED, AlarmId.CAMERA_DIRTY, AlarmId.CAMERA_LED_DEAD, AlarmId.REFERENCE_BAD)
"""Alarms that a refused reference raises."""


class JawsNotOpenError(GripError):
    """The jaws do not open fully: something may touch the gel."""

    def __init__(self, width_mm: float, widest_mm: float) -> None:
        super().__init__(messages.JAWS_NOT_OPEN(width_mm=width_mm, open_mm=widest_mm))
        self.width_mm = width_mm


def are_open(width_mm: float, widest_mm: float) -> bool:
    """Return whether a measured width is that of the open jaws, or of jaws that were to open to `widest_mm`."""
    return width_mm >= widest_mm - _OPEN_WITHIN_MM


async def open_jaws(rig: Rig) -> Position:
    """Open the jaws fully for a reference.

    Raises:
        JawsNotOpenError: they do not open, or something stops them.
    """
    opened = await rig.open()
    if opened.blocked or not are_open(opened.width_mm, rig.widest_mm):
        raise JawsNotOpenError(opened.width_mm, rig.widest_mm)
    return opened


async def take_reference(rig: Rig, number: int) -> Step:
    """Take frames of the untouched gel away from the nest, with the jaws open, and come back: a step without contact.

    Raises:
        JawsNotOpenError: as `open_jaws`.
        StationError: a fault of the rig.
    """
    await rig.make_ready()
    # Before the arm leaves: with closed fingers it would tear what they hold.
    opened = await open_jaws(rig)
    await rig.leave_nest()
    frames = await rig.frames(number)
    await rig.enter_nest()
    return Step(-1, opened, frames)


def reference_image(frames: Sequence[Frame]) -> Image:
    """Return the reference: the median of one or more frames, of one shape, of the untouched gel."""
    return median_image([frame.image for frame in frames])


class BadReferenceError(StationError):
    """The picture cannot be a reference; the message gives the reason and the remedy."""

    def __init__(self, alarm: AlarmId, message: Message) -> None:
        super().__init__(message)
        self.alarm = alarm


@dataclass(frozen=True, slots=True)
class ReferenceProperties:
    """Properties of a reference."""

    sharpness: float
    """Root mean square of its detail, grey levels."""
    saturated_share: float
    drift_levels: float
    """Root mean square of the light's change since the golden reference; 0 if there is none yet."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedReference:
    """A golden reference, prepared for comparisons."""

    shape: tuple[int, ...]
    sharpness: float
    light: tuple[float, float, float]
    method: Method
    renewal: Message
    """Instruction to make another one."""


def check_reference(image: Image, golden: PreparedReference | None, settings: ReferenceSettings) -> ReferenceProperties:
    """Check a candidate reference.

    Args:
        image: the median of frames taken with nothing touching the gel, shape (height, width, 3), dtype uint8.
        golden: None if there is none yet.

    Raises:
        BadReferenceError: it is not good enough.
    """
    saturated = saturated_share(image)
    if saturated > settings.saturated_share:
        raise BadReferenceError(
            AlarmId.CAMERA_SATURATED,
            messages.REFERENCE_SATURATED(found=100 * saturated, limit=100 * settings.saturated_share),
        )
    detail = sharpness(image)
    # A golden reference of another camera mode cannot be compared.
    if golden is None or golden.shape != image.shape:
        return ReferenceProperties(detail, saturated, 0.0)
    contact = golden.method.measure(image)
    drift = contact.drift_levels or 0.0
    share = detail / golden.sharpness
    # First, since without one colour there is less detail too.
    dead = any(now < DEAD_LED * before for now, before in zip(light(image), golden.light, strict=True))
    if not dead and share < settings.least_sharpness:
        raise BadReferenceError(
            AlarmId.CAMERA_DIRTY,
            messages.REFERENCE_BLURRED(found=100 * share, limit=100 * settings.least_sharpness),
        )
    if dead or drift > settings.most_drift_levels or Flag.REFERENCE_MISMATCH in contact.flags:
        raise BadReferenceError(
            AlarmId.CAMERA_LED_DEAD,
            messages.REFERENCE_LIGHT(levels=drift, renewal=golden.renewal),
        )
    # Of a method without a gate only the contact itself is known.
    if contact.found if contact.gate is None else contact.gate > settings.most_change:
        raise BadReferenceError(
            AlarmId.REFERENCE_BAD,
            messages.REFERENCE_TOUCHED(renewal=golden.renewal),
        )
    return ReferenceProperties(detail, saturated, drift)
