"""Stored images measured again by a draft: refused where the station would not have counted from the stored onset."""

import cv2
import numpy as np
import pytest

from station.inspection.press import Measured, Press
from station.messages import whatif as messages
from station.settings.segmentation import Segmentation
from station.vision.contact import Contact, contact_from_mask
from station.whatif import remeasure
from station.whatif.remeasure import CannotRemeasureError, remeasured
from station.whatif.stored import StoredPress

OWN = Segmentation()
DRAFT = OWN.model_copy(update={"robust": OWN.robust.model_copy(update={"gate_ratio": 5.0})})


def stored(closings_mm, areas_px) -> StoredPress:
    """A press whose images have each the brightness of their step, the reference that of none."""
    points = tuple(
        Measured(closing_mm, area_px * 0.001, area_px, 0.9)
        for closing_mm, area_px in zip(closings_mm, areas_px, strict=True)
    )
    levels = {None: 255, **{step: 10 * step for step in range(len(points))}}
    images = tuple(
        (step, cv2.imencode(".png", np.full((64, 64, 3), level, np.uint8))[1].tobytes())
        for step, level in levels.items()
    )
    return StoredPress(1, "A", "PASS", "x", Press(35.0, 0.4, points), images=images)


@pytest.fixture
def draft_finds(monkeypatch):
    """Let the draft find these areas, a weak contact where it is negative; the own recipe those that are stored."""

    def given(own_px, draft_px):
        class Method:
            stages: tuple[str, ...] = ()

            def __init__(self, segmentation: Segmentation) -> None:
                self._areas_px = draft_px if segmentation.robust.gate_ratio == 5.0 else own_px

            def measure(self, image: np.ndarray, **_: object) -> Contact:
                area_px = self._areas_px[int(image[0, 0, 0]) // 10]
                mask = np.zeros(image.shape[:2], np.uint8)
                mask[2:62, 2:62].flat[: abs(area_px)] = 255
                return contact_from_mask(mask, confidence=0.9, is_light=area_px < 0)

        monkeypatch.setattr(remeasure, "make_method", lambda _references, segmentation: Method(segmentation))

    return given


@pytest.mark.parametrize(
    ("closings_mm", "own_px", "draft_px", "known"),
    [
        ((0.0, 1.0, 2.0), (100, 400, 900), (90, 390, 880), True),
        ((0.0, 1.0, 2.0), (100, 400, 900), (0, 390, 880), False),
        ((0.0, 1.0, 2.0), (100, 400, 900), (-90, 390, 880), False),
        ((0.0, 1.0, 2.0), (100, 400, 900), (-90, -390, -880), False),
        ((-1.0, 0.0, 1.0), (0, 400, 900), (0, 390, 880), True),
        ((-1.0, 0.0, 1.0), (0, 400, 900), (-90, 390, 880), True),
        ((-1.0, 0.0, 1.0), (0, 400, 900), (90, 390, 880), False),
    ],
    ids=["firm", "none", "weak", "only weak", "from a width", "weak before", "firm before"],
)
def test_a_draft_with_another_onset_than_the_stored_one_is_refused(draft_finds, closings_mm, own_px, draft_px, known):
    draft_finds(own_px, draft_px)
    press = stored(closings_mm, own_px)
    if known:
        again = remeasured(press, OWN, DRAFT)
        assert [point.area_px for point in again.points] == [abs(area_px) for area_px in draft_px]
    else:
        with pytest.raises(CannotRemeasureError, check=lambda error: error.message == messages.OTHER_ONSET()):
            remeasured(press, OWN, DRAFT)
