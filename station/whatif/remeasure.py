"""A stored inspection's images measured again, by another segmentation."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np

from station.errors import StationError
from station.inspection.press import Flag, Measured, Press, usual_uncertainty_mm2
from station.settings.segmentation import Segmentation
from station.vision.contact import Image, Method
from station.vision.methods import make_method


class CannotRemeasureError(StationError):
    """The images that were kept do not tell what the other segmentation would have seen."""


def remeasured(
    press: Press, images: Sequence[tuple[int | None, bytes]], own: Segmentation, draft: Segmentation
) -> Press:
    """A press with the areas that another segmentation finds in the stored images.

    Stored is the mean of a step's frames. How far the frames disagreed is known from the stored confidence alone: it
    is a factor on the method's own, and is carried over.

    Args:
        press: as stored.
        images: PNG by step, None for the reference.
        own: the segmentation of then.
        draft: the segmentation to try.

    Raises:
        CannotRemeasureError: an image is missing or no image, or the draft would have seen the onset elsewhere.
    """
    decoded = {step: _decoded(data) for step, data in images}
    reference = decoded.get(None)
    missing = [step for step in range(len(press.points)) if step not in decoded]
    if reference is None or missing:
        raise CannotRemeasureError("the draft measures otherwise, and not all of its images were kept")
    before, after = make_method([reference], own), make_method([reference], draft)
    points = [_point(press, step, decoded, before, after, draft) for step in range(len(press.points))]
    if not points or points[0].area_px == 0:
        raise CannotRemeasureError("the draft sees no contact at the stored onset, so its steps would be others")
    return replace(press, points=tuple(points))


def _point(
    press: Press, step: int, decoded: Mapping[int | None, Image], before: Method, after: Method, draft: Segmentation
) -> Measured:
    stored = press.points[step]
    then, now = before.measure(decoded[step]), after.measure(decoded[step])
    confidence = now.confidence
    if confidence is not None and then.confidence and stored.confidence is not None:
        confidence *= min(1.0, stored.confidence / then.confidence)
    scale_mm2 = stored.area_mm2 / stored.area_px if stored.area_px else _scale(press)
    area_mm2 = now.area_px * scale_mm2
    flags = {Flag(flag.value) for flag in now.flags}
    if confidence is not None and confidence < draft.robust.least_confidence:
        flags.add(Flag.LOW_CONFIDENCE)
    return Measured(
        stored.closing_mm, area_mm2, now.area_px, usual_uncertainty_mm2(area_mm2), confidence, frozenset(flags)
    )


def _scale(press: Press) -> float:
    """mm² a pixel, from the points that have an area."""
    known = [point.area_mm2 / point.area_px for point in press.points if point.area_px]
    if not known:
        raise CannotRemeasureError("no stored point has an area, so the scale of its images is not known")
    return known[0]


def _decoded(data: bytes) -> Image:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise CannotRemeasureError("one of its images is damaged")
    return np.asarray(image, np.uint8)
