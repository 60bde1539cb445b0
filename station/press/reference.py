"""Reference check: whether a picture of the untouched gel may be the reference of a measurement."""

from dataclasses import dataclass

import numpy as np

from station.devices.camera.interface import Image
from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.messages import grip as messages
from station.messages.message import Message
from station.settings.service import ReferenceSettings
from station.vision.contact import Method
from station.vision.image_quality import DEAD_LED, light, sharpness
from station.vocabulary import Flag

_SATURATED_LEVEL = 250


ALARMS = (AlarmId.CAMERA_SATURATED, AlarmId.CAMERA_DIRTY, AlarmId.CAMERA_LED_DEAD, AlarmId.REFERENCE_BAD)
"""Alarms that a refused reference raises."""


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
        settings: limits for a good reference.

    Raises:
        BadReferenceError: it is not good enough.
    """
    saturated = float(np.mean(image.max(axis=2) >= _SATURATED_LEVEL))
    if saturated > settings.saturated_share:
        raise BadReferenceError(
            AlarmId.CAMERA_SATURATED,
            messages.REFERENCE_SATURATED(found=100 * saturated, limit=100 * settings.saturated_share),
        )
    detail = sharpness(image)
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
    if contact.found if contact.gate is None else contact.gate > settings.most_change:
        raise BadReferenceError(
            AlarmId.REFERENCE_BAD,
            messages.REFERENCE_TOUCHED(renewal=golden.renewal),
        )
    return ReferenceProperties(detail, saturated, drift)
