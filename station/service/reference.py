"""Whether a picture of the untouched gel may serve as the reference that everything is measured against."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from station.devices.camera.interface import Image
from station.errors import StationError
from station.inspection.alarm_table import AlarmId
from station.service.keeping import Kept
from station.settings.segmentation import Segmentation
from station.settings.service import ReferenceSettings
from station.vision.contact import Flag, Method
from station.vision.methods import make_method

_DETAIL_PX = (5.0, 15.0)
"""Between these two blurs lies what a lens shows and fog hides: structure of the light, above the pixels' noise."""
_SATURATED_LEVEL = 250
GOLDEN = "golden_reference.png"


ALARMS = (AlarmId.CAMERA_SATURATED, AlarmId.CAMERA_DIRTY, AlarmId.CAMERA_LED_DEAD, AlarmId.REFERENCE_BAD)
"""What a reference is refused with."""


class BadReferenceError(StationError):
    """The picture cannot be a reference; the message says why and what to do."""

    def __init__(self, alarm: AlarmId, text: str) -> None:
        super().__init__(text)
        self.alarm = alarm


@dataclass(frozen=True, slots=True)
class Looks:
    """What a reference looks like."""

    sharpness: float
    """Root mean square of its detail, grey levels."""
    saturated_share: float
    drift_levels: float
    """Root mean square of the light's change since the golden reference; 0 where there is none yet."""


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A golden reference that others are compared with."""

    shape: tuple[int, ...]
    sharpness: float
    method: Method
    renewal: str
    """How a person gets another one."""


class Golden:
    """The golden reference: the gel as it was when a person last saw that it was clean, kept in the home folder.

    A calibrated sensor's is its calibration's. Else the first reference that is taken becomes it; after a change of
    gel, or once dirt was wiped off, its file is removed by a person and the next reference takes its place.

    Args:
        kept: the home folder.
        calibrated: tells the file of the calibration's; None where there is none.
    """

    def __init__(self, kept: Kept, calibrated: Callable[[], Path | None] = lambda: None) -> None:
        self._kept, self._calibrated = kept, calibrated
        self._prepared: tuple[bytes, Segmentation, Prepared] | None = None

    def prepared(self, segmentation: Segmentation) -> Prepared | None:
        """The golden reference, ready to be compared with; None where there is none that can be read.

        Args:
            segmentation: the recipe's method, which looks for a contact between it and another reference.
        """
        data, renewal = self._read()
        if data is None:
            return None
        if self._prepared is None or self._prepared[:2] != (data, segmentation):
            picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
            if picture is None:
                return None
            image = np.asarray(picture, np.uint8)
            self._prepared = (
                data,
                segmentation,
                Prepared(image.shape, sharpness(image), make_method([image], segmentation), renewal),
            )
        return self._prepared[2]

    def keep_first(self, image: Image) -> None:
        """Make a picture the golden reference where there is none yet.

        Args:
            image: shape (height, width, 3), dtype uint8, BGR.
        """
        if self._read()[0] is None:
            self._kept.write(GOLDEN, cv2.imencode(".png", image)[1].tobytes())

    def _read(self) -> tuple[bytes | None, str]:
        """Its file's content, and how a person gets another one."""
        calibrated = self._calibrated()
        if calibrated is not None and (data := self._kept.read(str(calibrated))) is not None:
            return data, "calibrate"
        return self._kept.read(GOLDEN), f"remove {GOLDEN} from the home folder"


def examine(image: Image, golden: Prepared | None, settings: ReferenceSettings) -> Looks:
    """Judge what is to be a reference.

    Args:
        image: the median of frames taken with nothing touching the gel, shape (height, width, 3), dtype uint8.
        golden: the golden reference; None where there is none yet.
        settings: what is good enough.

    Raises:
        BadReferenceError: it cannot serve.
    """
    saturated = float(np.mean(image.max(axis=2) >= _SATURATED_LEVEL))
    if saturated > settings.saturated_share:
        raise BadReferenceError(
            AlarmId.CAMERA_SATURATED,
            f"reference: {saturated:.0%} of it are saturated, at most {settings.saturated_share:.0%} may be: "
            "keep outside light off the gel, or lower the LEDs",
        )
    detail = sharpness(image)
    if golden is None or golden.shape != image.shape:
        return Looks(detail, saturated, 0.0)
    contact = golden.method.measure(image)
    drift = contact.drift_levels or 0.0
    share = detail / golden.sharpness
    if share < settings.least_sharpness:
        raise BadReferenceError(
            AlarmId.CAMERA_DIRTY,
            f"reference: {share:.0%} as sharp as the golden reference, at least {settings.least_sharpness:.0%} are "
            "needed: clean the sensor's lens and gel",
        )
    if drift > settings.most_drift_levels or Flag.REFERENCE_MISMATCH in contact.flags:
        raise BadReferenceError(
            AlarmId.CAMERA_LED_DEAD,
            f"reference: its light differs from the golden reference's by {drift:.0f} grey levels: look at the "
            f"sensor's LEDs; after a change of gel or sensor {golden.renewal}",
        )
    if contact.found if contact.gate is None else contact.gate > settings.most_change:
        raise BadReferenceError(
            AlarmId.REFERENCE_BAD,
            "reference: something touches the gel that the golden reference does not have: take it out and wipe the "
            f"gel; if the gel was changed, {golden.renewal}",
        )
    return Looks(detail, saturated, drift)


def sharpness(image: Image) -> float:
    """Root mean square of the detail between two scales, grey levels.

    Args:
        image: shape (height, width, 3), dtype uint8.
    """
    finer, coarser = (cv2.GaussianBlur(image, (0, 0), sigma).astype(np.float32) for sigma in _DETAIL_PX)
    return float(np.sqrt(np.mean((finer - coarser) ** 2)))
