"""Runner of a what-if: many inspections judged again on all cores, or on a Dask cluster."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import cv2

from station.child_process import worker_processes
from station.dask_client import connect
from station.errors import StationError
from station.messages import whatif as messages
from station.records.database import reading
from station.settings.recipe_model import Recipe
from station.whatif.replay import Replayed, measured_otherwise, recipe_of_snapshot, replay
from station.whatif.stored import StoredPress, read_stored

CHUNK = 200
"""Inspections of a batch without images. An estimate."""
_WITH_IMAGES = 8
"""Inspections of a batch with images, which take more memory and time. An estimate."""
_AHEAD = 3
"""Batches that wait for each worker: enough that none is idle, few enough that memory stays small."""
_ALONE_S = 2.0
"""About the time that a process takes to start and to load its imports."""


class Batch(NamedTuple):
    """Input of a worker: plain values, so that it needs neither the database nor its disk."""

    stored: list[StoredPress]
    own: dict[str, str]
    """The recipes' canonical JSON, by their hash."""
    draft: str
    """The draft's canonical JSON."""


def replay_batch(batch: Batch) -> list[Replayed]:
    """Judge a batch, in any process."""
    # So that --jobs gives the number of cores used.
    cv2.setNumThreads(1)
    draft = Recipe.model_validate_json(batch.draft)
    own = {sha256: recipe_of_snapshot(text) for sha256, text in batch.own.items()}
    return [replay(stored, own.get(stored.recipe_sha256), draft) for stored in batch.stored]


def batches(folder: Path, wanted: Sequence[int], own: dict[str, str], draft: Recipe) -> Iterator[Batch]:
    """Read the inspections to be judged, batch by batch.

    Args:
        wanted: the inspections' sequences, ascending.
        own: the stored recipes, canonical JSON by hash.

    Raises:
        RecordsError: the records cannot be read.
    """
    known = [recipe for text in own.values() if (recipe := recipe_of_snapshot(text)) is not None]
    with_images = any(measured_otherwise(recipe, draft) for recipe in known)
    rest, size, text = iter(wanted), _WITH_IMAGES if with_images else CHUNK, draft.model_dump_json()
    with reading(folder) as connection:
        while part := list(islice(rest, size)):
            stored = read_stored(connection, part, folder, with_images=with_images)
            needed = {each.recipe_sha256: own[each.recipe_sha256] for each in stored}
            yield Batch(stored, needed, text)


def run(parts: Iterable[Batch], jobs: int, scheduler: str | None) -> Iterator[list[Replayed]]:
    """Judge batches, read as they are needed, in any order of completion.

    Args:
        jobs: processes on this machine; 1 works in this one.
        scheduler: a Dask scheduler's address, in place of this machine's processes.

    Raises:
        BadInputError: the address is invalid, or the extra `cluster` is not installed.
        StationError: a worker was lost.
    """
    if scheduler is not None:
        with _cluster(scheduler) as (submit, width):
            yield from _flow(parts, submit, width * _AHEAD)
    elif jobs == 1:
        yield from map(replay_batch, parts)
    else:
        yield from _on_cores(iter(parts), jobs)


def _on_cores(parts: Iterator[Batch], jobs: int) -> Iterator[list[Replayed]]:
    """Use this machine's cores. This process works too, and at first alone: small runs need no other process."""
    until_s = time.monotonic() + _ALONE_S
    for part in parts:
        yield replay_batch(part)
        if time.monotonic() > until_s:
            break
    else:
        return
    with worker_processes(jobs - 1) as pool:
        yield from _flow(parts, lambda batch: pool.submit(replay_batch, batch), (jobs - 1) * _AHEAD, helps=True)


@contextmanager
def _cluster(address: str) -> Iterator[tuple[Callable[[Batch], Any], int]]:
    """Use workers of a Dask cluster; they need this program installed, and nothing of this machine's disk."""
    with closing(connect(address)) as client:
        width = sum(client.nthreads().values())
        if not width:
            raise StationError(messages.NO_WORKERS(address=address))
        executor = client.get_executor(pure=False)
        yield lambda batch: executor.submit(replay_batch, batch), width


def _flow(
    parts: Iterable[Batch], submit: Callable[[Batch], Any], most: int, *, helps: bool = False
) -> Iterator[list[Replayed]]:
    """Keep up to `most` batches in progress; this process may help with others meanwhile."""
    source, under_way = iter(parts), set[Future[list[Replayed]]]()
    try:
        while True:
            for part in islice(source, most - len(under_way)):
                under_way.add(submit(part))
            mine = next(source, None) if helps else None
            if mine is not None:
                yield replay_batch(mine)
            if not under_way:
                return
            # While there is more to do here, the others are not waited for.
            done, under_way = wait(under_way, 0 if mine is not None else None, FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except BrokenProcessPool as error:
        raise StationError(messages.PROCESS_ENDED()) from error
    finally:
        for future in under_way:
            future.cancel()
