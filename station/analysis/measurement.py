"""Many images through one method, in order, on several threads."""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from station.analysis.decoding import Decoded
from station.analysis.sources import Source
from station.errors import BadInputError
from station.vision.contact import Contact, Image, Method

MakeMethod = Callable[[], Method]


@dataclass(frozen=True, slots=True)
class Measured:
    """One image with what was found in it."""

    source: Source
    image: Image
    contact: Contact
    conversions: tuple[str, ...]
    stages: dict[str, npt.NDArray[np.uint8]] = field(default_factory=dict)
    """The stages' pictures by name, in order; empty where they were not asked for."""


@dataclass(frozen=True, slots=True)
class Refused:
    """One image that could not be measured, and why."""

    source: Source
    reason: str


def measure_all(
    sources: Iterable[Source],
    shape: tuple[int, ...],
    make_method: MakeMethod,
    *,
    jobs: int,
    stages: bool,
) -> Iterator[Measured | Refused]:
    """Measure every source and give the results in the sources' order.

    Threads are enough: OpenCV releases the interpreter. At most two images a thread are held at once.

    Args:
        sources: what to measure; decoded here, one after the other, since a video can only be read forwards.
        shape: the reference's shape (height, width, 3).
        make_method: makes a method for one thread's use.
        jobs: number of threads, 1 or more.
        stages: whether the stages' pictures are wanted.
    """
    local = threading.local()

    def measure(source: Source, decoded: Decoded) -> Measured:
        if not hasattr(local, "method"):
            local.method = make_method()
        pictures: dict[str, npt.NDArray[np.uint8]] = {}
        contact = local.method.measure(decoded.image, pictures.__setitem__ if stages else None)
        return Measured(source, decoded.image, contact, decoded.conversions, pictures)

    waiting: deque[Future[Measured] | Refused] = deque()
    pool = ThreadPoolExecutor(jobs, thread_name_prefix="measure")
    try:
        for source in sources:
            try:
                decoded = source.load()
                _check_size(source, decoded, shape)
            except BadInputError as error:
                waiting.append(Refused(source, str(error)))
            else:
                waiting.append(pool.submit(measure, source, decoded))
            while len(waiting) > 2 * jobs:
                yield _finished(waiting.popleft())
        while waiting:
            yield _finished(waiting.popleft())
    finally:
        pool.shutdown(cancel_futures=True)


def _check_size(source: Source, decoded: Decoded, shape: tuple[int, ...]) -> None:
    if decoded.image.shape != shape:
        height, width = decoded.image.shape[:2]
        raise BadInputError(
            f"{source.name}: {width}x{height} px, but the reference has {shape[1]}x{shape[0]}; "
            "use a reference from the same sensor, mode and orientation"
        )


def _finished(item: "Future[Measured] | Refused") -> Measured | Refused:
    return item if isinstance(item, Refused) else item.result()
