"""Measurement of many images by one method: those of one press in order, the others on several threads."""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from station.analysis.decoding import Decoded
from station.analysis.presses import Run
from station.analysis.sources import Source
from station.analysis.stages import StagedMethod
from station.errors import BadInputError
from station.vision.contact import Contact, Image, Method
from station.vision.press import PressTracker

MakeMethod = Callable[[], Method]


@dataclass(frozen=True, slots=True)
class Measured:
    """One image with its measurement."""

    source: Source
    number: int
    """In the order given by the user, from 0."""
    image: Image
    contact: Contact
    conversions: tuple[str, ...]
    stages: dict[str, npt.NDArray[np.uint8]] = field(default_factory=dict)
    """The stages' pictures by name, in order; empty if not requested."""


@dataclass(frozen=True, slots=True)
class Refused:
    """One image that could not be measured, and why."""

    source: Source
    number: int
    """In the order given by the user, from 0."""
    reason: str


class _Press:
    """Measures the images of one press, one after the other, all in one thread, whose method `get_method` returns."""

    def __init__(self, get_method: MakeMethod, *, stages: bool) -> None:
        self._get_method, self._stages = get_method, stages
        self._staged: StagedMethod | None = None
        self._tracker: PressTracker | None = None

    def measure(self, image: Image) -> tuple[Contact, dict[str, npt.NDArray[np.uint8]]]:
        """Find the contact in the next image, of the reference's shape.

        Returns:
            The contact, and the stages' pictures by name.
        """
        if self._tracker is None:
            method = self._get_method()
            if self._stages:
                method = self._staged = StagedMethod(method)
            self._tracker = PressTracker(method)
        contact = self._tracker.measure_step([image])
        return contact, {} if self._staged is None else self._staged.pictures


def measure_all(
    sources: Sequence[Source],
    order: Iterable[Run],
    shape: tuple[int, ...],
    make_method: MakeMethod,
    *,
    jobs: int,
    stages: bool,
) -> Iterator[Measured | Refused]:
    """Measure every source and yield the results in the order of measurement.

    Threads are enough: OpenCV releases the interpreter. Single images are measured on several threads, those of a press
    on one thread while the next are decoded. An image of a press that cannot be measured is skipped. At most two images
    per thread are in memory at once.

    Args:
        sources: decoded here, one after the other, because a video can only be read forwards.
        order: every source once; a video's frames forwards.
        shape: the reference's shape (height, width, 3).
        make_method: makes a method for one thread's use.
        jobs: number of threads, 1 or more.
        stages: return the stages' pictures.
    """
    # A method is for one thread's use, so each thread makes its own.
    local = threading.local()

    def get_method() -> Method:
        if not hasattr(local, "method"):
            local.method = make_method()
        return local.method

    def measure(number: int, decoded: Decoded, press: _Press) -> Measured:
        contact, pictures = press.measure(decoded.image)
        return Measured(sources[number], number, decoded.image, contact, decoded.conversions, pictures)

    waiting: deque[Future[Measured] | Refused] = deque()
    pool, in_order = (ThreadPoolExecutor(count, thread_name_prefix="measure") for count in (jobs, 1))
    try:
        for run in order:
            press = _Press(get_method, stages=stages)
            for number in run.numbers:
                item = _load(sources[number], number, shape)
                executor = in_order if run.followed else pool
                waiting.append(item if isinstance(item, Refused) else executor.submit(measure, number, item, press))
                while len(waiting) > 2 * jobs:
                    yield _finished(waiting.popleft())
        while waiting:
            yield _finished(waiting.popleft())
    finally:
        for executor in (pool, in_order):
            executor.shutdown(cancel_futures=True)


def _load(source: Source, number: int, shape: tuple[int, ...]) -> Decoded | Refused:
    try:
        decoded = source.load()
    except BadInputError as error:
        return Refused(source, number, str(error))
    if decoded.image.shape == shape:
        return decoded
    height, width = decoded.image.shape[:2]
    why = (
        f"{source.name}: {width}x{height} px, but the reference has {shape[1]}x{shape[0]}; "
        "use a reference from the same sensor, mode and orientation"
    )
    return Refused(source, number, why)


def _finished(item: "Future[Measured] | Refused") -> Measured | Refused:
    return item if isinstance(item, Refused) else item.result()
