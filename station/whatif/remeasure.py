"""Remeasurement of a stored inspection's images by another segmentation."""

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np

from station.calibration.gate import gated
from station.errors import StationError
from station.inspection.press import Measured, Press
from station.messages import whatif as messages
from station.settings.segmentation import Segmentation
from station.vision.contact import Image
from station.vision.methods import make_method
from station.vision.press import PressTracker
from station.vocabulary import Flag
from station.whatif.stored import StoredPress

_SAME_AREA, _SAME_PX = 0.02, 50
"""Greatest difference of a remeasured area from the stored one, for other versions of OpenCV; usually 0."""


class CannotRemeasureError(StationError):
    """The stored images do not give the result of the other segmentation."""


def remeasured(stored: StoredPress, own: Segmentation, draft: Segmentation) -> Press:
    """Return a press with the areas that another segmentation finds in the stored images.

    They are measured as the station measured them: as one press, step after step from the onset. The stored image is
    the mean of a step's frames. The disagreement of the frames is known only from the stored confidence: it is a factor
    on the method's own confidence, and is taken over.

    Raises:
        CannotRemeasureError: an image is missing or no image, the images do not give the stored areas, or the draft
            would have found the onset at another width.
    """
    press = stored.press
    own, draft = gated(own, stored.gate_factor), gated(draft, stored.gate_factor)
    decoded = {step: _decoded(data) for step, data in stored.images}
    reference = decoded.get(None)
    missing = [step for step in range(len(press.points)) if step not in decoded]
    if reference is None or missing:
        raise CannotRemeasureError(messages.IMAGES_NOT_KEPT())
    before, after = (PressTracker(make_method(reference, one)) for one in (own, draft))
    measured = [_measured(press, step, decoded, before, after, draft) for step in range(len(press.points))]
    # The station counts the closing from the first firm contact, never from a weak one.
    onset = next((step for step, (_, is_firm) in enumerate(measured) if is_firm), None)
    if onset is None or press.points[onset].closing_mm != 0:
        raise CannotRemeasureError(messages.OTHER_ONSET())
    return replace(press, points=tuple(point for point, _ in measured))


def _measured(
    press: Press,
    step: int,
    decoded: Mapping[int | None, Image],
    before: PressTracker,
    after: PressTracker,
    draft: Segmentation,
) -> tuple[Measured, bool]:
    """Return a step as the draft measures it, and whether its contact is firm."""
    stored = press.points[step]
    then, now = before.measure_step([decoded[step]]), after.measure_step([decoded[step]])
    if abs(then.area_px - stored.area_px) > max(_SAME_PX, _SAME_AREA * stored.area_px):
        raise CannotRemeasureError(messages.OTHER_PROGRAM())
    confidence = now.confidence
    if confidence is not None and then.confidence and stored.confidence is not None:
        # The agreement of the frames, which is 1 at most.
        confidence *= min(1.0, stored.confidence / then.confidence)
    scale_mm2 = stored.area_mm2 / stored.area_px if stored.area_px else _scale(press)
    area_mm2 = now.area_px * scale_mm2
    flags = set(now.flags)
    # The method set its flags by the confidence before that factor.
    if confidence is not None and confidence < draft.robust.least_confidence:
        flags.add(Flag.LOW_CONFIDENCE)
    return Measured(stored.closing_mm, area_mm2, now.area_px, confidence, frozenset(flags)), now.is_firm


def _scale(press: Press) -> float:
    """Return mm² per pixel, from the points that have an area."""
    known = [point.area_mm2 / point.area_px for point in press.points if point.area_px]
    if not known:
        raise CannotRemeasureError(messages.NO_SCALE())
    return known[0]


def _decoded(data: bytes) -> Image:
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise CannotRemeasureError(messages.DAMAGED_IMAGE())
    return np.asarray(image, np.uint8)
