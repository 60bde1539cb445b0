"""Measures images in one thread of its own, so that neither the channel nor the arm's lease waits for a picture."""

import asyncio
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import cv2

from station.devices.camera.interface import Frame, Image
from station.service.grip import GripStep
from station.service.reference import Golden, Looks, examine
from station.settings.segmentation import Segmentation
from station.settings.service import ReferenceSettings
from station.vision.contact import Contact, Method
from station.vision.methods import make_method, median_image
from station.vision.step import mean_image, measure_step

ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """One width step as it was measured."""

    step: GripStep
    image: Image
    """The frames' mean, shape (height, width, 3), dtype uint8, BGR."""
    contact: Contact


class Eye:
    """The measurement against one reference at a time.

    Args:
        golden: the reference that every new one is compared with.
        settings: what makes a reference good enough.
    """

    def __init__(self, golden: Golden, settings: ReferenceSettings) -> None:
        cv2.setNumThreads(max(1, (os.cpu_count() or 1) - 1))
        self._golden, self._settings = golden, settings
        self._worker = ThreadPoolExecutor(1, "vision")
        self._method: Method | None = None
        self._least_confidence = 0.0

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
            image = median_image([frame.image for frame in frames])
            looks = examine(image, self._golden.prepared(segmentation), self._settings)
            self._golden.keep_first(image)
            self._method, self._least_confidence = (
                make_method([image], segmentation),
                segmentation.robust.least_confidence,
            )
            return image, looks

        return await self._do(take)

    async def measure(self, step: GripStep) -> Seen:
        """Find the contact in a step's frames.

        Args:
            step: with frames of the reference's shape.
        """

        def measure() -> Seen:
            if self._method is None:
                raise RuntimeError("a step is measured before the reference was taken")
            images = [frame.image for frame in step.frames]
            return Seen(step, mean_image(images), measure_step(self._method, images, self._least_confidence))

        return await self._do(measure)

    async def _do(self, work: Callable[[], ResultT]) -> ResultT:
        return await asyncio.get_running_loop().run_in_executor(self._worker, work)
