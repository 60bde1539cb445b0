"""Tactile camera interface of the station."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from station.errors import StationError
from station.messages import camera as messages
from station.messages.message import Message

Image = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.uint8]


class CameraError(StationError):
    """The camera cannot be used; the message gives the reason and the remedy."""


class NoCameraError(CameraError):
    """No such camera answers."""


class NoFrameError(CameraError):
    """No frame as new as requested came in time."""


class CameraProtocolError(CameraError):
    """A message that the camera's protocol does not allow."""


class FrameFault(StrEnum):
    """Faults of a frame; a faulty frame is not measured."""

    STALE = "stale"
    """Captured too long ago."""
    REPEATED = "repeated"
    """The same pixels as the frame before: a live sensor's noise never repeats."""
    TORN = "torn"
    """Two pieces that do not fit along one line."""
    SHIFTED = "shifted"
    """Rolled sideways: the image begins in its middle."""
    BLACK = "black"
    SATURATED = "saturated"
    WRONG_SIZE = "wrong_size"
    """Not the requested mode."""


FRAME_FAULTS: dict[FrameFault, Message] = {
    FrameFault.STALE: messages.FRAME_STALE(),
    FrameFault.REPEATED: messages.FRAME_REPEATED(),
    FrameFault.TORN: messages.FRAME_TORN(),
    FrameFault.SHIFTED: messages.FRAME_SHIFTED(),
    FrameFault.BLACK: messages.FRAME_BLACK(),
    FrameFault.SATURATED: messages.FRAME_SATURATED(),
    FrameFault.WRONG_SIZE: messages.FRAME_WRONG_SIZE(),
}


def describe(faults: Iterable[FrameFault]) -> list[Message]:
    """Return the faults as messages, in the order of their names."""
    return [FRAME_FAULTS[fault] for fault in sorted(faults)]


@dataclass(frozen=True, slots=True)
class CameraDescription:
    """Identity of the camera, and its frames' properties."""

    name: str
    width_px: int
    height_px: int
    mm_per_px: float
    frames_per_s: float | None
    """None if frames come as fast as they are requested."""
    serial: str = ""
    """Of the sensor, by which its calibration is found; empty for a recording."""
    revision: str = ""
    """Of the sensor and its firmware, in its maker's digits; empty if unknown."""
    notice: Message | None = None
    """A condition that needs a person though frames come."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One image with its number and its time."""

    image: Image
    """Shape (height, width, 3), dtype uint8, BGR, portrait; never changed after it was published."""
    sequence: int
    captured_s: float
    """Monotonic time (`time.monotonic`) at which it was captured."""
    faults: frozenset[FrameFault] = frozenset()


@dataclass(frozen=True, slots=True)
class Leds:
    """Brightness of each colour, 0 (off) to 15."""

    red: int
    green: int
    blue: int


class Camera(Protocol):
    """A tactile camera. Drivers open nothing before `open` and leave nothing open after `close`."""

    @property
    def description(self) -> CameraDescription:
        """Return the camera's description; complete once it is open."""
        ...

    async def open(self) -> None:
        """Find the camera and wait for its first frame. Idempotent.

        Raises:
            CameraError: there is no such camera, or it gives no frame within the settings' deadline.
        """
        ...

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        """Return the first available frame captured after a monotonic time.

        A frame with faults is returned too: the caller decides whether to try again.

        Raises:
            NoFrameError: no such frame came in time; also while the camera is lost and being searched.
        """
        ...

    async def set_leds(self, leds: Leds) -> None:
        """Set the light. Idempotent; a camera without settable light does nothing.

        Raises:
            CameraError: the camera does not answer.
        """
        ...

    async def close(self) -> None:
        """Release the camera. Idempotent."""
        ...
