"""Frame feed: the driver's newest frame for the station; no queue, no old frame."""

import asyncio
import time

from station.devices.camera.health import FrameHealth
from station.devices.camera.interface import Frame, FrameFault, Image, NoFrameError
from station.messages import camera as messages
from station.messages.message import Message


class FrameFeed:
    """Newest frame of one camera, checked only when it is taken; without a `remedy` messages name cable and light."""

    def __init__(self, name: Message, health: FrameHealth, remedy: Message | None = None) -> None:
        self._name, self._health, self._remedy = name, health, remedy or messages.REMEDY_CABLE()
        self._changed = asyncio.Event()
        self._image: Image | None = None
        self._before: Image | None = None
        self._captured_s = 0.0
        self._sequence = 0
        self._given: Frame | None = None
        self.trouble: Message | None = messages.NOTHING_SENT()
        """The driver's faults since the last frame; part of the message if no frame comes."""

    def publish(self, image: Image, captured_s: float, sequence: int | None = None) -> None:
        """Set a new frame; only from the event loop's thread.

        Args:
            image: shape (height, width, 3), dtype uint8; not changed from now on.
            captured_s: monotonic time of its capture.
            sequence: the device's own number of the frame; counted here if the device has none.
        """
        self._before, self._image = self._image, image
        self._captured_s = captured_s
        self._sequence = self._sequence + 1 if sequence is None else sequence
        self.trouble = None
        self._changed.set()

    async def newer(self, newer_than_s: float, deadline_s: float) -> Frame:
        """Return the newest frame, once there is one captured after a monotonic time.

        Raises:
            NoFrameError: none came in time.
        """
        try:
            async with asyncio.timeout(deadline_s):
                while (image := self._image) is None or self._captured_s <= newer_than_s:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError:
            raise NoFrameError(
                messages.NO_FRAME(camera=self._name, limit_s=deadline_s, reasons=self._reasons(), remedy=self._remedy)
            ) from None
        if self._given is None or self._given.sequence != self._sequence:
            self._given = self._judged(image)
        return self._given

    def _reasons(self) -> list[Message]:
        seen = self._image is not None
        newest = messages.NEWEST(age_s=time.monotonic() - self._captured_s) if seen else None
        return [reason for reason in (newest, self.trouble) if reason is not None]

    def _judged(self, image: Image) -> Frame:
        faults: frozenset[FrameFault] = self._health.judge(image, self._before, time.monotonic() - self._captured_s)
        return Frame(image, self._sequence, self._captured_s, faults)
