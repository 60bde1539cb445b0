"""Ball press: presses the ball step by step and measures it, for calibration and verification."""

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from station.calibration.gate import gated
from station.calibration.model import PressPoint
from station.calibration.rig import Pressed, Rig
from station.messages import calibration as messages
from station.messages.message import Message
from station.settings.recipe import Recipe
from station.vision.contact import Contact, Image, Method
from station.vision.methods import make_method, median_image
from station.vision.step import mean_image, measure_step
from station.vocabulary import Flag

FINEST_STEP_MM = 0.4
"""A count of the gripper."""
_CONTRAST_BLUR_PX = 2.0
_CONTRAST_PERCENTILE = 90.0
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

    def __init__(self, rig: Rig, recipe: Recipe, gate_factor: float = 1.0) -> None:
        self._rig, self._recipe = rig, recipe
        self._segmentation = gated(recipe.segmentation, gate_factor)
        self._method: Method | None = None
        self.reference: Image | None = None

    async def take_reference(self, number: int) -> Sequence[Image]:
        """Take frames of the untouched gel, and measure against their median from now on."""
        frames = await self._rig.untouched(number)
        self.reference = await asyncio.to_thread(median_image, frames)
        self._method = await asyncio.to_thread(make_method, [self.reference], self._segmentation)
        return frames

    async def measure(self, frames: Sequence[Image]) -> Contact:
        """Measure frames of one width.

        Args:
            frames: of the reference's shape.
        """
        if self._method is None:
            raise RuntimeError("a press is measured before its reference was taken")
        least = self._recipe.segmentation.robust.least_confidence
        return await asyncio.to_thread(measure_step, self._method, frames, least)

    async def step(self, width_mm: float) -> Step:
        """Move to a width and measure there."""
        pressed: Pressed = await self._rig.press_to(width_mm)
        contact = await self.measure(pressed.frames)
        image = mean_image(pressed.frames)
        assert self.reference is not None  # noqa: S101 (measured against it just now)
        strength = await asyncio.to_thread(contrast, image, self.reference, contact)
        return Step(pressed.width_mm, image, contact, strength)

    async def fine_onset(self, untouched_mm: float, touched_mm: float) -> float:
        """Search the contact onset, to a count of the gripper.

        Args:
            untouched_mm: a width without contact.
            touched_mm: a smaller one with contact.
        """
        width_mm = untouched_mm - FINEST_STEP_MM
        while width_mm > touched_mm + FINEST_STEP_MM / 2:
            step = await self.step(width_mm)
            if step.contact.is_firm:
                return step.width_mm
            width_mm -= FINEST_STEP_MM
        return touched_mm


def contrast(image: Image, reference: Image, contact: Contact) -> float:
    """Return the change of the image by a contact, grey levels: a worn gel loses it first.

    Args:
        image: shape (height, width, 3), dtype uint8.
        reference: same shape.
        contact: found in the image; without one the contrast is 0.
    """
    if not contact.found or contact.centroid_px is None:
        return 0.0
    change = image.astype(np.float32) - reference
    change -= np.median(change[::4, ::4], axis=(0, 1))
    length = np.linalg.norm(cv2.GaussianBlur(change, (0, 0), _CONTRAST_BLUR_PX), axis=2)
    around = np.zeros(image.shape[:2], np.uint8)
    radius = _ROOM * float(np.sqrt(contact.area_px / np.pi))
    x, y = contact.centroid_px
    cv2.circle(around, (round(x), round(y)), round(radius), 255, cv2.FILLED)
    return float(np.percentile(length[around > 0], _CONTRAST_PERCENTILE))
