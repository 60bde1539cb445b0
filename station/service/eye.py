"""Measures images in one thread of its own, so that neither the channel nor the arm's lease waits for a picture."""

import asyncio
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import cv2

from station.devices.camera.interface import Frame, Image
from station.service.grip import GripStep
from station.service.reference import Golden, Looks, examine
from station.settings.segmentation import Segmentation
from station.settings.service import ReferenceSettings
from station.vision.contact import Contact, Method, StageSink
from station.vision.methods import make_method, median_image
from station.vision.step import mean_image, measure_step

ResultT = TypeVar("ResultT")

_SWITCH_S = 0.0005
"""How long the measuring thread may keep the interpreter from the loop, which asks a moving gripper some twenty things
in a step; Python's own 5 ms made that step up to 30 ms longer."""


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One width step as it was measured."""

    step: GripStep
    image: Image
    """The frames' mean, shape (height, width, 3), dtype uint8, BGR."""
    contact: Contact


class _Begun:
    """A method that knows the images whose measurement was begun before it was asked for them.

    Args:
        method: for all other images.
        known: what each of these images shows, by the image's identity; who asks takes it out.
    """

    def __init__(self, method: Method, known: dict[int, tuple[Image, Future[Contact]]]) -> None:
        self.stages, self._method, self._known = method.stages, method, known

    def measure(self, image: Image, on_stage: StageSink | None = None, previous: Contact | None = None) -> Contact:
        """See `Method.measure`."""
        begun = self._known.pop(id(image), None)
        return self._method.measure(image, on_stage, previous) if begun is None else begun[1].result()


class Eye:
    """The measurement against one reference at a time.

    Args:
        golden: the reference that every new one is compared with.
        settings: what makes a reference good enough.
    """

    def __init__(self, golden: Golden, settings: ReferenceSettings) -> None:
        sys.setswitchinterval(_SWITCH_S)
        cv2.setNumThreads(max(1, (os.cpu_count() or 1) - 1))
        self._golden, self._settings = golden, settings
        self._worker = ThreadPoolExecutor(1, "vision")
        self._method: Method | None = None
        self._least_confidence = 0.0
        self._begun: dict[int, tuple[Image, Future[Contact]]] = {}

    def close(self) -> None:
        """End the thread, after what it is doing."""
        self._worker.shutdown()

    async def take_reference(self, frames: Sequence[Frame], segmentation: Segmentation) -> tuple[Image, Looks]:
        """Examine frames of the untouched gel, and measure against them from now on.

        The first reference of a sensor becomes the golden one.

        Args:
            frames: of one shape.
            segmentation: the recipe's method.

        Returns:
            The reference, shape (height, width, 3), dtype uint8, BGR, and what it looks like.

        Raises:
            BadReferenceError: they cannot serve; there is no reference then.
        """

        def take() -> tuple[Image, Looks]:
            self._method = None
            self._begun.clear()
            image = median_image([frame.image for frame in frames])
            looks = examine(image, self._golden.prepared(segmentation), self._settings)
            self._golden.keep_first(image)
            self._method, self._least_confidence = (
                make_method([image], segmentation),
                segmentation.robust.least_confidence,
            )
            return image, looks

        return await self._do(take)

    def look_ahead(self, frame: Frame) -> None:
        """Begin to measure one frame of a step while the next is waited for; `measure` then has less to do.

        Args:
            frame: of the reference's shape.
        """
        if (method := self._method) is not None:
            self._begun[id(frame.image)] = frame.image, self._worker.submit(method.measure, frame.image)

    async def measure(self, step: GripStep) -> Seen:
        """Find the contact in a step's frames.

        Args:
            step: with frames of the reference's shape.
        """

        def measure() -> Seen:
            if self._method is None:
                raise RuntimeError("a step is measured before the reference was taken")
            images = [frame.image for frame in step.frames]
            method = _Begun(self._method, self._begun)
            return Seen(step, mean_image(images), measure_step(method, images, self._least_confidence))

        return await self._do(measure)

    async def _do(self, work: Callable[[], ResultT]) -> ResultT:
        return await asyncio.get_running_loop().run_in_executor(self._worker, work)
