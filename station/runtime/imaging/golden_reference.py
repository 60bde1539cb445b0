"""Golden reference: the stored picture of the untouched gel that every new reference is compared with."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from station.devices.camera.interface import Image
from station.messages import grip as messages
from station.messages.message import Message
from station.press.reference import PreparedReference
from station.settings.segmentation import Segmentation
from station.state_files import StateFiles
from station.vision.image_quality import light, sharpness
from station.vision.methods import make_method

GOLDEN = "golden_reference.png"


class GoldenReference:
    """Golden reference: the gel when a person last checked that it was clean, stored in the home folder.

    For a calibrated sensor it is the calibration's. Else it is the first reference that is taken; a noted change of the
    gel removes the file, or a person after its cleaning, and the next reference replaces it.
    """

    def __init__(self, state_files: StateFiles, calibrated: Callable[[], Path | None] = lambda: None) -> None:
        self._state_files, self._calibrated = state_files, calibrated
        self._prepared: tuple[bytes, Segmentation, PreparedReference] | None = None

    def prepared(self, segmentation: Segmentation) -> PreparedReference | None:
        """Return the golden reference, prepared for comparisons by a segmentation; None if none can be read."""
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
                PreparedReference(
                    image.shape, sharpness(image), light(image), make_method(image, segmentation), renewal
                ),
            )
        return self._prepared[2]

    def store_first(self, image: Image) -> None:
        """Store a picture, (height, width, 3), uint8, BGR, as the golden reference if there is none yet."""
        if self._read()[0] is None:
            self._state_files.write(GOLDEN, cv2.imencode(".png", image)[1].tobytes())

    def _read(self) -> tuple[bytes | None, Message]:
        """Return its file's content, and the instruction to make another one."""
        calibrated = self._calibrated()
        if calibrated is not None and (data := self._state_files.read(str(calibrated))) is not None:
            return data, messages.RENEW_BY_CALIBRATION()
        return self._state_files.read(GOLDEN), messages.RENEW_BY_REMOVAL(file=GOLDEN)
