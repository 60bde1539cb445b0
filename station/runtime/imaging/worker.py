"""Vision worker: measures a press's steps in one thread, so that neither channel nor the arm's lease waits for it."""

import asyncio
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import cv2

from station.press.measurement import PressMeasurement
from station.press.reference import ReferenceProperties, check_reference, reference_image
from station.press.rig import Frame, MeasuredStep, Step
from station.runtime.imaging.golden_reference import GoldenReference
from station.settings.segmentation import Segmentation
from station.settings.service import ReferenceSettings
from station.vision.contact import Contact, Image
from station.vision.methods import make_method

ResultT = TypeVar("ResultT")

_SWITCH_S = 0.0005
"""Longest time for which the measuring thread may hold the interpreter's lock against the event loop, which queries a
moving gripper some twenty times in a step; Python's own 5 ms made that step up to 30 ms longer."""


class VisionWorker:
    """Measurement against one reference at a time.

    One thread does the work in the order of the calls, so a frame's measurement ahead always uses the same earlier step
    as its step's measurement.
    """

    def __init__(self, golden: GoldenReference, settings: ReferenceSettings) -> None:
        sys.setswitchinterval(_SWITCH_S)
        # One core is left for the PLC interface's process, whose replies have hard time limits (decision 17).
        cv2.setNumThreads(max(1, (os.cpu_count() or 1) - 1))
        self._golden, self._settings = golden, settings
        self._worker = ThreadPoolExecutor(1, "vision")
        self._measurement: PressMeasurement | None = None
        """Against the present reference; only the worker thread uses it."""

    def close(self) -> None:
        """Finish the work under way and end the thread."""
        self._worker.shutdown()

    async def take_reference(
        self, frames: Sequence[Frame], segmentation: Segmentation
    ) -> tuple[Image, ReferenceProperties]:
        """Check frames, of one shape, of the untouched gel, and measure against them from now on.

        The first reference of a sensor becomes the golden one.

        Returns:
            The reference, shape (height, width, 3), dtype uint8, BGR, and its properties.

        Raises:
            BadReferenceError: the frames give no good reference; there is none then.
        """

        def take() -> tuple[Image, ReferenceProperties]:
            self._measurement = None
            image = reference_image(frames)
            properties = check_reference(image, self._golden.prepared(segmentation), self._settings)
            self._golden.store_first(image)
            self._measurement = PressMeasurement(make_method(image, segmentation))
            return image, properties

        return await self._do(take)

    async def begin_press(self) -> None:
        """Measure each step by itself again, against the same reference, after the jaws were opened."""

        def begin() -> None:
            if self._measurement is not None:
                self._measurement.begin()

        await self._do(begin)

    async def follow(self, contact: Contact) -> None:
        """Measure every later step as one of the press with this first contact, until the next press or reference."""
        await self._do(lambda: self._referenced().follow(contact))

    def measure_ahead(self, frame: Frame) -> None:
        """Start measuring one frame, of the reference's shape, of the next step; `measure` then has less to do."""

        def measure() -> None:
            # Checked again in its turn: a reference that was refused meanwhile leaves none.
            if self._measurement is not None:
                self._measurement.prepare_next(frame.image)

        if self._measurement is not None:
            self._worker.submit(measure)

    async def measure(self, step: Step) -> MeasuredStep:
        """Find the contact in a step's frames, which have the reference's shape."""
        return await self._do(lambda: self._referenced().measure(step))

    async def seek(self, step: Step) -> MeasuredStep:
        """Measure a step of the approach, in the reference's shape, where only a firm contact counts."""
        return await self._do(lambda: self._referenced().seek(step))

    def _referenced(self) -> PressMeasurement:
        if self._measurement is None:
            raise RuntimeError("a step is measured before the reference was taken")
        return self._measurement

    async def _do(self, work: Callable[[], ResultT]) -> ResultT:
        return await asyncio.get_running_loop().run_in_executor(self._worker, work)
