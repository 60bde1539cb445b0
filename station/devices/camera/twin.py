"""Twin camera: the simulated DIGIT over TCP; its messages are described in docs/twin.md.

Everything received is validated; a connection that breaks the protocol, goes silent or is cut is closed and reopened
for as long as the camera is open.
"""

import asyncio
import contextlib
import json
import math
import os
import struct
import time
from collections.abc import AsyncIterator
from typing import Any

import numpy as np

from station.devices.camera.connection import Connection, connect
from station.devices.camera.feed import FrameFeed
from station.devices.camera.health import FrameHealth
from station.devices.camera.interface import (
    CameraDescription,
    CameraError,
    CameraProtocolError,
    Frame,
    Image,
    Leds,
    Mask,
    NoCameraError,
    NoFrameError,
)
from station.messages import camera as messages
from station.messages.message import Definition, Message
from station.settings.camera import CameraSettings

_LENGTH = struct.Struct(">I")
_LONGEST_HEADER = 4096
_LONGEST_SIDE = 4096
_SILENCE_S = 2.0
_OLDEST_S = 1e6
_RETRY_S = 0.1
_SIZE = (640, 480)
_FRAMES_PER_S = 30.0


class TwinCamera:
    """Driver `twin`."""

    def __init__(self, settings: CameraSettings) -> None:
        self._settings = settings
        self._where = f"{settings.twin.host}:{settings.twin.port}"
        self._feed = FrameFeed(messages.TWIN(address=self._where), FrameHealth(settings.oldest_s, _SIZE))
        self._listening: asyncio.Task[None] | None = None

    @property
    def description(self) -> CameraDescription:
        """Return the camera's description."""
        height, width = _SIZE
        name, serial = f"twin DIGIT at {self._where}", f"TWIN-{self._settings.twin.port}"
        return CameraDescription(name, width, height, self._settings.mm_per_px, _FRAMES_PER_S, serial)

    async def open(self) -> None:
        """Connect and wait for the first frame. Idempotent.

        Raises:
            NoCameraError: nothing answers there, or it sends no frame within the settings' deadline.
        """
        if self._listening is None:
            self._listening = asyncio.create_task(self._listen_for_ever(), name="twin camera")
        try:
            await self._feed.newer(-math.inf, self._settings.open_deadline_s)
        except NoFrameError as error:
            await self.close()
            limit_s, reason = self._settings.open_deadline_s, self._feed.trouble or messages.NOTHING_SENT()
            raise NoCameraError(
                messages.TWIN_NO_FIRST_FRAME(address=self._where, limit_s=limit_s, reason=reason)
            ) from error

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        """See `Camera.frame`."""
        return await self._feed.newer(newer_than_s, deadline_s)

    async def set_leds(self, leds: Leds) -> None:
        """Set the light. Idempotent.

        Raises:
            CameraError: the twin does not answer, or refuses.
        """
        request = {"kind": "leds", "red": leds.red, "green": leds.green, "blue": leds.blue}
        async with self._asked(request, messages.TWIN_LIGHT_NOT_SET) as connection:
            answer = await _read_header(connection)
        if answer.get("kind") != "leds":
            reason = str(answer.get("message"))
            raise CameraError(messages.TWIN_LIGHT_REFUSED(address=self._where, reason=reason))

    async def true_mask(self, sequence: int, shape: tuple[int, ...]) -> Mask:
        """Return the true contact mask of one of the last frames, which only a twin has; never for a measurement.

        Returns:
            Shape (height, width), dtype uint8, 0 or 255.

        Raises:
            CameraError: the twin does not answer, or the frame is too old.
        """
        async with self._asked({"kind": "truth", "sequence": sequence}, messages.TWIN_TRUTH_NOT_READ) as connection:
            answer = await _read_header(connection)
            if answer.get("kind") != "truth" or answer.get("bytes") != shape[0] * shape[1]:
                reason = str(answer.get("message"))
                raise CameraError(messages.TWIN_NO_TRUTH(address=self._where, reason=reason))
            pixels = await connection.read(answer["bytes"])
        return np.frombuffer(pixels, np.uint8).reshape(shape[:2])

    async def close(self) -> None:
        """Disconnect. Idempotent."""
        task, self._listening = self._listening, None
        if task:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def _listen_for_ever(self) -> None:
        while True:
            try:
                await self._listen()
            except CameraProtocolError as error:
                self._feed.trouble = error.message
            except (OSError, EOFError) as error:
                self._feed.trouble = _describe(error)
            await asyncio.sleep(_RETRY_S)

    async def _listen(self) -> None:
        async with asyncio.timeout(_SILENCE_S):
            connection = await self._ask({"kind": "stream"})
        try:
            last = -1
            while True:
                async with asyncio.timeout(_SILENCE_S):
                    header = await _read_header(connection)
                    received_s = time.monotonic()
                    image, sequence, age_s = await _read_frame(connection, header)
                if sequence <= last:
                    raise CameraProtocolError(messages.WRONG_ORDER(found=str(sequence), before=str(last)))
                last = sequence
                self._feed.publish(image, received_s - age_s, sequence=sequence)
        finally:
            await connection.close()

    @contextlib.asynccontextmanager
    async def _asked(self, request: dict[str, Any], failed: Definition) -> AsyncIterator[Connection]:
        """Ask on a connection of its own; raise `CameraError` with `failed` where that breaks."""
        try:
            async with asyncio.timeout(_SILENCE_S):
                connection = await self._ask(request)
                try:
                    yield connection
                finally:
                    await connection.close()
        except (OSError, EOFError) as error:
            raise CameraError(failed(address=self._where, reason=_describe(error))) from error

    async def _ask(self, request: dict[str, Any]) -> Connection:
        connection = await connect(self._settings.twin.host, self._settings.twin.port)
        header = json.dumps(request).encode()
        connection.write(_LENGTH.pack(len(header)) + header)
        return connection


def _describe(error: OSError | EOFError) -> Message:
    """Describe the connection's failure."""
    if isinstance(error, EOFError):
        return messages.LINK_CLOSED()
    if isinstance(error, TimeoutError):
        return messages.LINK_SILENT(limit_s=_SILENCE_S)
    number = error.errno or 0
    return messages.LINK_FAILED(reason=os.strerror(number) if number > 0 else error.strerror or str(error))


async def _read_header(connection: Connection) -> dict[str, Any]:
    (length,) = _LENGTH.unpack(await connection.read(_LENGTH.size))
    if length > _LONGEST_HEADER:
        raise CameraProtocolError(messages.LONG_HEADER(found=length, limit=_LONGEST_HEADER))
    text = await connection.read(length)
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise CameraProtocolError(messages.UNREADABLE_HEADER(reason=str(error))) from error
    if not isinstance(header, dict):
        raise CameraProtocolError(messages.WRONG_HEADER())
    return header


async def _read_frame(connection: Connection, header: dict[str, Any]) -> tuple[Image, int, float]:
    if header.get("kind") != "frame":
        kind, reason = repr(header.get("kind")), str(header.get("message"))
        raise CameraProtocolError(messages.NO_FRAME_HEADER(kind=kind, reason=reason))
    height, width, sequence = (_whole(header, key) for key in ("height", "width", "sequence"))
    age_s = header.get("age_s")
    if isinstance(age_s, bool) or not isinstance(age_s, int | float) or not 0 <= age_s < _OLDEST_S:
        raise CameraProtocolError(messages.WRONG_AGE(found=f"{age_s!s:.40}", limit=_OLDEST_S))
    if not (0 < height <= _LONGEST_SIDE and 0 < width <= _LONGEST_SIDE):
        size = {"width": str(width), "height": str(height)}
        raise CameraProtocolError(messages.WRONG_SIZE(**size, limit=_LONGEST_SIDE))
    if header.get("bytes") != height * width * 3:
        found = repr(header.get("bytes"))
        raise CameraProtocolError(messages.WRONG_LENGTH(found=found, width=width, height=height))
    image = np.empty((height, width, 3), np.uint8)
    await connection.fill(image.data.cast("B"))
    return image, sequence, float(age_s)


def _whole(header: dict[str, Any], key: str) -> int:
    value = header.get(key)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise CameraProtocolError(messages.NOT_WHOLE(key=key, found=repr(value)))
    return value
