"""A study's cohort on a Dask cluster of processes: the same numbers as on one, and how much sooner."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from distributed import LocalCluster

from station.studies.study import Request, run_study

FRUIT, SEED, METHOD = "raspberry", 26, "robust"
WARM_SAMPLES = 4
"""Of another seed, before the time is taken: a worker imports the vision with its first sample."""


class Run(NamedTuple):
    """One measured cohort."""

    workers: int
    """Of the cluster; 0 for the study's own process."""
    took_s: float
    samples: dict[str, bytes]
    """The stored samples by their files' names, with the summary and the curves."""


@contextmanager
def cluster(workers: int) -> Iterator[str]:
    """A scheduler and workers of one thread, each a process; its address."""
    with LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
    ) as running:
        yield running.scheduler_address


def measure(folder: Path, workers: int, samples: int) -> Run:
    """Measure the cohort in a new folder.

    Args:
        folder: that is made.
        workers: of a cluster; 0 for this process alone.
        samples: of the cohort.
    """
    if not workers:
        return _run(folder, 0, samples, None)
    with cluster(workers) as address:
        run_study(_request(folder / "warm", WARM_SAMPLES, SEED + 1, address), lambda _: None, lambda: None)
        return _run(folder / "study", workers, samples, address)


def different(runs: Sequence[Run]) -> list[str]:
    """Names of the files in which a run differs from the first one, with its workers."""
    first = runs[0].samples
    return [
        f"{name} with {run.workers} workers"
        for run in runs[1:]
        for name in sorted(first.keys() | run.samples.keys())
        if run.samples.get(name) != first.get(name)
    ]


def _request(out: Path, samples: int, seed: int, address: str | None) -> Request:
    return Request(FRUIT, samples, seed, METHOD, out, 1, address)


def _run(folder: Path, workers: int, samples: int, address: str | None) -> Run:
    began_s = time.perf_counter()
    run_study(_request(folder, samples, SEED, address), lambda _: None, lambda: None)
    took_s = time.perf_counter() - began_s
    files = [*sorted((folder / "samples").iterdir()), folder / "summary.json", folder / "curves.csv"]
    return Run(workers, took_s, {file.name: file.read_bytes() for file in files})
