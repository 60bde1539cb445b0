"""Vision worker: measures a press's steps in one thread, so that neither channel nor the arm's lease waits for it."""

import asyncio
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import cv2

from station.devices.camera.interface import Frame, Image
from station.press.procedure import GripStep
from station.press.reference import ReferenceProperties, check_reference
from station.runtime.imaging.golden_reference import GoldenReference
from station.settings.segmentation import Segmentation
from station.settings.service import ReferenceSettings
from station.vision.contact import Contact, Method
from station.vision.methods import make_method, median_image
from station.vision.press import PressTracker
from station.vision.step import mean_image

ResultT = TypeVar("ResultT")

_SWITCH_S = 0.0005
"""Longest time for which the measuring thread may hold the interpreter's lock against the event loop, which queries a
moving gripper some twenty times in a step; Python's own 5 ms made that step up to 30 ms longer."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredStep:
    """One width step as it was measured."""

    step: GripStep
    image: Image
    """The frames' mean, shape (height, width, 3), dtype uint8, BGR."""
    contact: Contact


class VisionWorker:
    """Measurement against one reference at a time.

    The jaws may open again while the onset is searched, so each step is measured by itself then. From `follow` on the
    compression only rises: each step is measured with the contact of the step before. One thread does the work in the
    order of the calls, so a frame's measurement ahead always uses the same earlier step as its step's measurement.

    Args:
        golden: reference that every new one is compared with.
        settings: limits for a good reference.
    """

    def __init__(self, golden: GoldenReference, settings: ReferenceSettings) -> None:
        sys.setswitchinterval(_SWITCH_S)
        cv2.setNumThreads(max(1, (os.cpu_count() or 1) - 1))
        self._golden, self._settings = golden, settings
        self._worker = ThreadPoolExecutor(1, "vision")
        self._method: Method | None = None
        self._least_confidence = 0.0
        self._tracker: PressTracker | None = None
        """Of the press that is followed, or of the next step alone; only the worker thread uses it."""
        self._follows = False

    def close(self) -> None:
        """Finish the work under way and end the thread."""
        self._worker.shutdown()

    async def take_reference(
        self, frames: Sequence[Frame], segmentation: Segmentation
    ) -> tuple[Image, ReferenceProperties]:
        """Check frames of the untouched gel, and measure against them from now on.

        The first reference of a sensor becomes the golden one.

        Args:
            frames: of one shape.
            segmentation: of the recipe.

        Returns:
            The reference, shape (height, width, 3), dtype uint8, BGR, and its properties.

        Raises:
            BadReferenceError: the frames give no good reference; there is none then.
        """

        def take() -> tuple[Image, ReferenceProperties]:
            self._method = self._tracker = None
            self._follows = False
            image = median_image([frame.image for frame in frames])
            properties = check_reference(image, self._golden.prepared(segmentation), self._settings)
            self._golden.store_first(image)
            self._method, self._least_confidence = (
                make_method([image], segmentation),
                segmentation.robust.least_confidence,
            )
            return image, properties

        return await self._do(take)

    async def begin_press(self) -> None:
        """Measure each step by itself again, against the same reference, after the jaws were opened."""

        def begin() -> None:
            self._tracker, self._follows = None, False

        await self._do(begin)

    async def follow(self, contact: Contact) -> None:
        """Measure every later step as a step of one press, until the next press or reference.

        Args:
            contact: of the press's first step, against this reference.
        """

        def follow() -> None:
            self._tracker, self._follows = self._new_tracker(contact), True

        await self._do(follow)

    def measure_ahead(self, frame: Frame) -> None:
        """Start measuring one frame of the next step while more are captured; `measure` then has less to do.

        Args:
            frame: of the reference's shape.
        """

        def measure() -> None:
            if self._method is not None:
                self._tracker = self._tracker or self._new_tracker()
                self._tracker.prepare_next(frame.image)

        if self._method is not None:
            self._worker.submit(measure)

    async def measure(self, step: GripStep) -> MeasuredStep:
        """Find the contact in a step's frames.

        Args:
            step: with frames of the reference's shape.
        """

        def measure() -> MeasuredStep:
            tracker = self._tracker or self._new_tracker()
            if not self._follows:
                self._tracker = None
            images = [frame.image for frame in step.frames]
            return MeasuredStep(step, mean_image(images), tracker.measure_step(images))

        return await self._do(measure)

    def _new_tracker(self, first: Contact | None = None) -> PressTracker:
        if self._method is None:
            raise RuntimeError("a step is measured before the reference was taken")
        return PressTracker(self._method, self._least_confidence, first)

    async def _do(self, work: Callable[[], ResultT]) -> ResultT:
        return await asyncio.get_running_loop().run_in_executor(self._worker, work)
