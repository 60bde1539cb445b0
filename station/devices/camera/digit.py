"""Driver of the DIGIT on USB, by OpenCV's V4L2 capture. Unverified on hardware; its pure parts are tested.

Sources: the sensor's published USB descriptor (vendor 2833, product 0209) and its public driver's behaviour: VGA at
30 frames/s in YUYV, LEDs of 4 bits a colour packed into the UVC zoom control (firmware 2.00 and newer).
"""

import asyncio
import contextlib
import math
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

import cv2
import numpy as np

from station.devices.camera.feed import FrameFeed
from station.devices.camera.health import FrameHealth
from station.devices.camera.interface import (
    CameraDescription,
    CameraError,
    Frame,
    Image,
    Leds,
    NoCameraError,
    NoFrameError,
)
from station.messages import camera as messages
from station.messages.message import Message
from station.settings.camera import CameraSettings

SYSFS = Path("/sys/class/video4linux")
_VENDOR, _PRODUCT = "2833", "0209"
_MODE = (640, 480, 30.0)
_LIGHT_SINCE = "0200"
"""`bcdDevice` of firmware 2.00, from which on each colour's light can be set."""
_RETRY_S = 0.5
_OLDEST_STAMP_S = 10.0
"""A kernel's time of more than this ago is of another clock. Queued frames may be old, and must not pass for new."""
_STOP_DEADLINE_S = 12.0
"""Longer than the 10 s for which OpenCV's V4L2 select may wait."""


class Capture(Protocol):
    """Used part of `cv2.VideoCapture`."""

    def isOpened(self) -> bool: ...  # noqa: N802, D102 (OpenCV's name)
    def set(self, propId: int, value: float, /) -> bool: ...  # noqa: D102
    def get(self, propId: int, /) -> float: ...  # noqa: D102
    def read(self) -> tuple[bool, Image]: ...  # noqa: D102
    def release(self) -> None: ...  # noqa: D102


class DigitDevice(NamedTuple):
    """A DIGIT that the kernel lists."""

    serial: str
    node: str
    """Such as /dev/video0."""
    revision: str = ""
    """Of the sensor and its firmware, from the USB descriptor: 0200 for 2.00."""


def find_digits(sysfs: Path = SYSFS) -> list[DigitDevice]:
    """Find the connected DIGITs, in the order of their nodes."""
    found = []
    for entry in sorted(sysfs.glob("video*"), key=lambda path: (len(path.name), path.name)):
        usb = (entry / "device").resolve().parent
        identity = [_text(usb / name) for name in ("idVendor", "idProduct", "serial", "bcdDevice")]
        # Index 0 is the node that captures; a UVC device's others carry metadata.
        if identity[:2] == [_VENDOR, _PRODUCT] and _text(entry / "index") in {"0", ""}:
            found.append(DigitDevice(identity[2], f"/dev/{entry.name}", identity[3]))
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""


def packed_leds(leds: Leds) -> int:
    """Return the zoom control's value for a light: red in bits 8 to 11, green in 4 to 7, blue in 0 to 3.

    Raises:
        ValueError: a brightness is not from 0 to 15.
    """
    for colour, level in (("red", leds.red), ("green", leds.green), ("blue", leds.blue)):
        if not 0 <= level <= 15:
            raise ValueError(f"{colour} is {level}; expected 0 to 15")
    return leds.red << 8 | leds.green << 4 | leds.blue


def to_portrait(image: Image) -> Image:
    """Rotate a picture of shape (480, 640, 3), dtype uint8, to (640, 480, 3): transposed, then flipped upside down."""
    return np.asarray(cv2.flip(cv2.transpose(image), 0), np.uint8)


def set_mode(capture: Capture, serial: str) -> None:
    """Set VGA at 30 frames/s in YUYV on an open capture, and check the mode that the camera gives.

    Raises:
        CameraError: another mode was given.
    """
    width, height, frames_per_s = _MODE
    capture.set(cv2.CAP_PROP_FOURCC, float(cv2.VideoWriter.fourcc(*"YUYV")))
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    capture.set(cv2.CAP_PROP_FPS, frames_per_s)
    properties = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT, cv2.CAP_PROP_FPS)
    given = tuple(capture.get(one) for one in properties)
    if given != _MODE:
        raise CameraError(
            messages.WRONG_MODE(
                serial=serial,
                width=width,
                height=height,
                rate=frames_per_s,
                given_width=given[0],
                given_height=given[1],
                given_rate=given[2],
            )
        )


def open_v4l2(node: str) -> Capture:
    """Open a node with OpenCV."""
    return cv2.VideoCapture(node, cv2.CAP_V4L2)  # pyrefly: ignore[bad-return] (OpenCV's stub has MatLike)


def captured_at_s(capture: Capture, now_s: float) -> float:
    """Return the monotonic time of the frame that was just read.

    OpenCV's V4L2 capture gives the kernel's time of the buffer as the position in ms: for uvcvideo on the monotonic
    clock, when the frame began to come in; a frame of VGA is read some 30 to 60 ms later. Its exposure may have started
    up to a frame's period before. Where the time is of another clock, the time of reading is taken. Unverified on
    hardware.
    """
    stamp_s = capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
    return stamp_s if 0.0 <= now_s - stamp_s <= _OLDEST_STAMP_S else now_s


class DigitCamera:
    """Driver `digit`: a thread reads frame after frame, so that the kernel's buffers never have an old one.

    Of these there is more than one: with a single one the sensor has none to fill while a frame is read, and loses the
    next. Unverified on hardware.

    A lost sensor is searched by its serial number until the camera is closed.
    """

    def __init__(
        self, settings: CameraSettings, sysfs: Path = SYSFS, opener: Callable[[str], Capture] = open_v4l2
    ) -> None:
        self._settings, self._sysfs, self._opener = settings, sysfs, opener
        self._serial = settings.digit.serial
        self._revision = ""
        self._notice: Message | None = None
        self._name = messages.DIGIT(serial=self._serial)
        width, height = _MODE[1], _MODE[0]
        self._feed = FrameFeed(self._name, FrameHealth(settings.oldest_s, (height, width)))
        self._leds = Leds(settings.digit.red, settings.digit.green, settings.digit.blue)
        self._leds_wanted = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def description(self) -> CameraDescription:
        """Return the camera's description; portrait."""
        scale, name = self._settings.mm_per_px, str(self._name)
        return CameraDescription(name, _MODE[1], _MODE[0], scale, _MODE[2], self._serial, self._revision, self._notice)

    async def open(self) -> None:
        """Find the sensor and wait for its first frame. Idempotent: after an error the search goes on until `close`.

        Raises:
            NoCameraError: no such sensor is plugged in, or it gives no frame within the settings' deadline.
        """
        if self._thread is None:
            self._stopping.clear()
            self._leds_wanted.set()
            loop = asyncio.get_running_loop()
            self._thread = threading.Thread(target=self._capture_for_ever, args=(loop,), name="digit", daemon=True)
            self._thread.start()
        try:
            await self._feed.newer(-math.inf, self._settings.open_deadline_s)
        except NoFrameError as error:
            limit_s, reason = self._settings.open_deadline_s, self._feed.trouble or messages.NOTHING_SENT()
            raise NoCameraError(messages.NO_FIRST_FRAME(camera=self._name, limit_s=limit_s, reason=reason)) from error

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        """See `Camera.frame`."""
        return await self._feed.newer(newer_than_s, deadline_s)

    async def set_leds(self, leds: Leds) -> None:
        """Set the light as soon as the frame under way is read, which still has the old one. Idempotent.

        Raises:
            ValueError: a brightness is not from 0 to 15.
        """
        packed_leds(leds)
        self._leds = leds
        self._leds_wanted.set()

    async def close(self) -> None:
        """Release the sensor. Idempotent."""
        thread, self._thread = self._thread, None
        if thread:
            self._stopping.set()
            await asyncio.to_thread(thread.join, _STOP_DEADLINE_S)

    def _set_light(self, capture: Capture) -> None:
        taken = capture.set(cv2.CAP_PROP_ZOOM, packed_leds(self._leds))
        self._notice = None
        if self._revision and self._revision < _LIGHT_SINCE:
            self._notice = messages.LIGHT_FIRMWARE(revision=_LIGHT_SINCE)
        elif not taken:
            self._notice = messages.LIGHT_REFUSED()

    def _capture_for_ever(self, loop: asyncio.AbstractEventLoop) -> None:
        while not self._stopping.is_set():
            try:
                self._capture(loop)
            except CameraError as error:
                self._feed.trouble = error.message
            except Exception as error:  # noqa: BLE001 (after any error of OpenCV the sensor is searched again)
                self._feed.trouble = messages.READING_FAILED(reason=str(error))
            self._stopping.wait(_RETRY_S)

    def _capture(self, loop: asyncio.AbstractEventLoop) -> None:
        devices = find_digits(self._sysfs)
        device = next((device for device in devices if device.serial == self._serial), None)
        if device is None:
            others = ", ".join(device.serial for device in devices)
            raise NoCameraError(
                messages.NOT_PLUGGED_IN(serial=self._serial, found=others)
                if others
                else messages.NONE_PLUGGED_IN(serial=self._serial)
            )
        node, self._revision = device.node, device.revision
        capture = self._opener(node)
        try:
            if not capture.isOpened():
                raise NoCameraError(messages.NOT_OPENED(node=node))
            set_mode(capture, self._serial)
            self._leds_wanted.set()
            while not self._stopping.is_set():
                if self._leds_wanted.is_set():
                    # Cleared first: a light that is wanted meanwhile is set before the next frame.
                    self._leds_wanted.clear()
                    self._set_light(capture)
                read, image = capture.read()
                captured_s = captured_at_s(capture, time.monotonic())
                if not read or image is None:
                    raise NoCameraError(messages.NO_MORE_FRAMES(node=node))
                with contextlib.suppress(RuntimeError):  # the loop may have closed meanwhile
                    loop.call_soon_threadsafe(self._feed.publish, to_portrait(image), captured_s)
        finally:
            capture.release()
