"""Ball press: presses the ball step by step and measures it, for calibration and verification."""

import asyncio
import logging
from dataclasses import dataclass

import cv2
import numpy as np

from station.calibration.gate import gated
from station.calibration.model import PressPoint
from station.calibration.rig import BallRig
from station.errors import StationError
from station.messages import calibration as messages
from station.messages.message import Message
from station.press.measurement import PressMeasurement
from station.press.procedure import bracketed_onset_mm, release_to_the_end, take_step
from station.press.reference import reference_image, take_reference
from station.press.rig import MeasuredStep
from station.press.rig import Step as PressStep
from station.settings.recipe_model import Recipe
from station.vision.contact import Contact, Image
from station.vision.methods import make_method
from station.vocabulary import Flag

log = logging.getLogger(__name__)

_CONTRAST_BLUR_PX = 2.0
"""Standard deviation of the smoothing of the change whose strength is measured. An estimate."""
_CONTRAST_PERCENTILE = 90.0
"""Percentile of the change around a contact that is its strength: a few pixels do not decide it. An estimate."""
_ROOM = 1.2
"""Share of a contact's radius: the gel changes most just inside and outside its edge."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One width step as it was measured."""

    width_mm: float
    image: Image
    """The frames' mean."""
    contact: Contact
    contrast_levels: float

    @property
    def message(self) -> Message:
        """Return the width with the contact's area."""
        if not self.contact.found:
            return messages.NO_CONTACT_AT(width_mm=self.width_mm)
        return messages.AREA_AT(width_mm=self.width_mm, area_px=self.contact.area_px)

    @property
    def point(self) -> PressPoint:
        """Return the part that is stored."""
        return PressPoint(
            width_mm=round(self.width_mm, 3),
            area_px=self.contact.area_px,
            confidence=None if self.contact.confidence is None else round(self.contact.confidence, 3),
            cut=Flag.CUT_BY_BORDER in self.contact.flags,
            contrast_levels=round(self.contrast_levels, 2),
        )


class BallPress:
    """Presses and measures by a recipe."""

    def __init__(self, rig: BallRig, recipe: Recipe, gate_factor: float = 1.0) -> None:
        self._rig, self._recipe = rig, recipe
        self._segmentation = gated(recipe.segmentation, gate_factor)
        self._measurement: PressMeasurement | None = None
        self.reference: Image | None = None

    async def let_go(self) -> None:
        """Open the jaws after a failure, whose cause matters more than their own; to the end, also when called off.

        Raises:
            asyncio.CancelledError: called off meanwhile; raised once the jaws are open.
        """
        try:
            await release_to_the_end(self._rig)
        except StationError as error:
            log.warning("the jaws could not be opened: %s", error)

    async def take_reference(self, number: int) -> PressStep:
        """Take frames of the untouched gel, and measure against their median from now on."""
        untouched = await take_reference(self._rig, number)
        self.reference = await asyncio.to_thread(reference_image, untouched.frames)
        method = await asyncio.to_thread(make_method, self.reference, self._segmentation)
        self._measurement = PressMeasurement(method)
        return untouched

    async def measure(self, step: PressStep) -> MeasuredStep:
        """Measure a step by itself."""
        if self._measurement is None:
            raise RuntimeError("a press is measured before its reference was taken")
        # In a thread: the event loop renews the arm's lease meanwhile, without which the controller stops the arm.
        return await asyncio.to_thread(self._measurement.measure, step)

    async def step(self, width_mm: float) -> Step:
        """Move to a width and measure there."""
        seen = await self.measure(await take_step(self._rig, self._recipe, 0, width_mm))
        assert self.reference is not None  # noqa: S101 (measured against it just now)
        strength = await asyncio.to_thread(contrast, seen.image, self.reference, seen.contact)
        return Step(seen.step.move.width_mm, seen.image, seen.contact, strength)

    async def fine_onset(self, untouched_mm: float, touched_mm: float) -> float:
        """Search the onset between a width without and a smaller one with contact, to a count of the gripper."""
        return await bracketed_onset_mm(self._rig, self._recipe, untouched_mm, touched_mm, self.measure)


def contrast(image: Image, reference: Image, contact: Contact) -> float:
    """Return an image's change by a contact, grey levels, 0 without one: a worn gel loses it first."""
    if not contact.found or contact.centroid_px is None:
        return 0.0
    change = image.astype(np.float32) - reference
    # The light's own change since the reference: a contact over less than half of the field hardly moves the median.
    change -= np.median(change[::4, ::4], axis=(0, 1))
    # The length over the colours: in their mean, opposite changes would cancel.
    length = np.linalg.norm(cv2.GaussianBlur(change, (0, 0), _CONTRAST_BLUR_PX), axis=2)
    around = np.zeros(image.shape[:2], np.uint8)
    radius = _ROOM * float(np.sqrt(contact.area_px / np.pi))
    x, y = contact.centroid_px
    cv2.circle(around, (round(x), round(y)), round(radius), 255, cv2.FILLED)
    return float(np.percentile(length[around > 0], _CONTRAST_PERCENTILE))
