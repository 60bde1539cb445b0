"""Replay camera: a recording, a folder of images or a video, in real time or as fast as requested."""

import asyncio
import math
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from natsort import natsorted

from station.devices.camera.feed import FrameFeed
from station.devices.camera.health import FrameHealth
from station.devices.camera.interface import CameraDescription, CameraError, Frame, Image, Leds, NoCameraError
from station.messages import camera as messages
from station.settings.camera import CameraSettings

_IMAGES = {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"}
_ENDED = messages.REPLAY_ENDED()


class ReplayCamera:
    """Driver `replay`. A recording is played once; opening again starts it from the beginning."""

    def __init__(self, settings: CameraSettings) -> None:
        self._settings = settings
        self._source = Path(settings.replay.source)
        self._frames: Iterator[Image] | None = None
        self._feed: FrameFeed | None = None
        self._playing: asyncio.Task[None] | None = None
        self._size = (0, 0)

    @property
    def description(self) -> CameraDescription:
        """Return the recording's description; its size is known once it is open."""
        height, width = self._size
        replay = self._settings.replay
        name = str(messages.REPLAY(source=str(self._source)))
        return CameraDescription(name, width, height, self._settings.mm_per_px, replay.frames_per_s)

    async def open(self) -> None:
        """Read the first frame, and start the clock of a replay in real time. Idempotent.

        Raises:
            NoCameraError: the recording is missing, empty or no recording.
        """
        if self._feed:
            return
        self._frames = read_frames(self._source)
        first = await asyncio.to_thread(next, self._frames, None)
        if first is None:
            raise NoCameraError(messages.REPLAY_EMPTY(source=str(self._source)))
        self._size = (first.shape[0], first.shape[1])
        health = FrameHealth(self._settings.oldest_s, self._size)
        self._feed = FrameFeed(messages.REPLAY(source=str(self._source)), health, messages.REMEDY_REPLAY())
        self._publish(first)
        if self._settings.replay.frames_per_s:
            self._playing = asyncio.create_task(self._play(1.0 / self._settings.replay.frames_per_s), name="replay")

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        """See `Camera.frame`; without a rate each call after the first gives the next frame and ignores `newer_than_s`.

        Raises:
            NoFrameError: no such frame came in time, or the recording has ended.
            CameraError: the camera is not open.
        """
        if self._feed is None:
            raise CameraError(messages.REPLAY_NOT_OPEN())
        if self._settings.replay.frames_per_s:
            return await self._feed.newer(newer_than_s, deadline_s)
        if self._feed.trouble == _ENDED:
            return await self._feed.newer(math.inf, 0.0)
        frame = await self._feed.newer(-math.inf, deadline_s)
        await self._advance()
        return frame

    async def set_leds(self, leds: Leds) -> None:
        """Do nothing: recorded frames keep their light."""

    async def close(self) -> None:
        """Stop playing. Idempotent."""
        task, self._playing = self._playing, None
        if task:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
        self._feed = self._frames = None

    async def _play(self, period_s: float) -> None:
        while await self._advance(period_s):
            pass

    async def _advance(self, wait_s: float = 0.0) -> bool:
        """Publish the next frame after a wait; False at the end."""
        if self._frames is None or self._feed is None:
            return False
        began_s = time.monotonic()
        following = await asyncio.to_thread(next, self._frames, None)
        if following is None:
            self._feed.trouble = _ENDED
            return False
        await asyncio.sleep(max(0.0, began_s + wait_s - time.monotonic()))
        self._publish(following)
        return True

    def _publish(self, image: Image) -> None:
        if self._feed:
            self._feed.publish(image, time.monotonic())


def read_frames(source: Path) -> Iterator[Image]:
    """Yield the frames of a folder, in natural order, or of a video, read one by one.

    Raises:
        NoCameraError: there is no such recording, or an image in it cannot be read.
    """
    if source.is_dir():
        for path in natsorted(path for path in source.iterdir() if path.suffix.lower() in _IMAGES):
            image = cv2.imread(str(path), cv2.IMREAD_COLOR)
            if image is None:
                raise NoCameraError(messages.REPLAY_UNREADABLE(file=str(path)))
            yield np.asarray(image, np.uint8)
        return
    if not source.is_file():
        raise NoCameraError(messages.REPLAY_MISSING(source=str(source)))
    video = cv2.VideoCapture(str(source))
    try:
        while True:
            read, image = video.read()
            if not read:
                return
            yield np.asarray(image, np.uint8)
    finally:
        video.release()
