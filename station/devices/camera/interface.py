"""What the station asks of a tactile camera, whichever it is."""

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from station.errors import StationError

Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.uint8]


class CameraError(StationError):
    """The camera cannot be used; the message says why and what to do."""


class NoCameraError(CameraError):
    """No such camera answers."""


class NoFrameError(CameraError):
    """No frame as new as was asked for came in time."""


class CameraProtocolError(CameraError):
    """What came is not what the camera's protocol allows."""


class FrameFault(StrEnum):
    """What is wrong with a frame; such a frame is not measured."""

    STALE = "stale"
    """Captured too long ago."""
    REPEATED = "repeated"
    """The very pixels of the frame before: a live sensor's noise never does that."""
    TORN = "torn"
    """Two pieces that do not fit along one line."""
    SHIFTED = "shifted"
    """Rolled sideways: the image begins in its middle."""
    BLACK = "black"
    SATURATED = "saturated"
    WRONG_SIZE = "wrong_size"
    """Not the mode that was asked for."""


@dataclass(frozen=True, slots=True)
class CameraDescription:
    """Which camera it is and what its frames are."""

    name: str
    width_px: int
    height_px: int
    mm_per_px: float
    frames_per_s: float | None
    """None where frames come as fast as they are asked for."""
    serial: str = ""
    """Of the sensor, by which its calibration is found; empty for a recording."""
    revision: str = ""
    """Of the sensor and its firmware, in its maker's digits; empty where none is told."""
    notice: str = ""
    """What does not keep it from giving frames, and still wants a person; empty where there is nothing."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One image with its number and its time."""

    image: Image
    """Shape (height, width, 3), dtype uint8, BGR, portrait; never changed after it was handed out."""
    sequence: int
    captured_s: float
    """Monotonic time (`time.monotonic`) at which it was captured."""
    faults: frozenset[FrameFault] = frozenset()
    width_mm: float | None = None
    """The gripper's width that was recorded with it; only a replay knows one."""

    @property
    def content_hash(self) -> str:
        """BLAKE2b of the pixels, 16 bytes in hexadecimal; about a millisecond, so it is made only when asked for."""
        return hashlib.blake2b(np.ascontiguousarray(self.image).data, digest_size=16).hexdigest()


@dataclass(frozen=True, slots=True)
class Leds:
    """Brightness of each colour, 0 (off) to 15."""

    red: int
    green: int
    blue: int


class Camera(Protocol):
    """A tactile camera. Drivers hold nothing open before `open` and nothing after `close`."""

    @property
    def description(self) -> CameraDescription:
        """Which camera it is; complete once it is open."""
        ...

    async def open(self) -> None:
        """Find the camera and wait for its first frame. Idempotent.

        Raises:
            CameraError: there is no such camera, or it gives no frame within the settings' deadline.
        """
        ...

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        """The first frame at hand that was captured after a time.

        A frame with faults is given too: the caller decides whether to ask again.

        Args:
            newer_than_s: monotonic time that the capture must come after.
            deadline_s: longest wait, in seconds.

        Raises:
            NoFrameError: no such frame came in time; also while the camera is lost and being looked for again.
        """
        ...

    async def set_leds(self, leds: Leds) -> None:
        """Set the light. Idempotent; a camera without settable light does nothing.

        Args:
            leds: brightness of each colour.

        Raises:
            CameraError: the camera does not answer.
        """
        ...

    async def close(self) -> None:
        """Let the camera go. Idempotent."""
        ...
