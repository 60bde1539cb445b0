"""Samples of a running station: each process's memory, descriptors and threads, and what the station publishes."""

import contextlib
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import psutil
from hmi_load.rounds import OWN_PHASES
from prometheus_client.parser import text_string_to_metric_families

from .heap import in_use_bytes

MARKS = {
    "service": "-m station service",
    "arm": "-m station.devices.arm.process",
    "plc": "-m station plc run",
    "hmi": "-m station hmi",
    "outbox": "-m station outbox run",
    "twin": "-m station twin",
}
"""Processes by what their command line contains; the twin is none of the station's."""
TWIN = "twin"
_MB = 1e6


class ProcessSample(NamedTuple):
    """One process at one time."""

    pid: int
    unique_mb: float
    """Memory that no other process shares: what would be free without it."""
    in_use_mb: float
    """Of that, what is not free in the process's heap."""
    resident_mb: float
    descriptors: int
    threads: int


class StationCounts(NamedTuple):
    """Values of the station's metrics at one time."""

    fruit: float
    own_s: float
    """Time of the cycle's phases in which nothing moves and no frame is awaited."""
    whole_s: float
    """Time from triggers to durable outcomes."""
    images_kept: float
    images_removed: float
    waiting: float
    """Entries that the outbox has not sent yet, of both destinations."""


class Latency(NamedTuple):
    """Response times to a PLC that reads each scan, in one window."""

    p50_us: float
    p99_us: float
    worst_us: float


class Sample(NamedTuple):
    """One window's end."""

    at_s: float
    """Since the first fruit."""
    processes: dict[str, ProcessSample]
    latency: Latency
    bare: Latency
    """Of the same server with no station behind it, read by a client of the same kind in the same window."""
    work_ms: float
    """Mean time of a fixed piece of work in that window."""
    counts: StationCounts
    images_mb: float
    """Space of the records' images."""
    database_mb: float
    """Space of the records' database with its log."""


def processes(marked: Sequence[psutil.Process]) -> dict[str, ProcessSample]:
    """Return the station's processes by name.

    Args:
        marked: candidates; those that end meanwhile are left out.
    """
    found = dict[str, ProcessSample]()
    for process in marked:
        with contextlib.suppress(psutil.NoSuchProcess), process.oneshot():
            line = " ".join(process.cmdline())
            name = next((name for name, mark in MARKS.items() if mark in line), None)
            if name is not None:
                memory, in_use_mb = process.memory_full_info(), in_use_bytes(process.pid) / _MB
                pieces = process.num_fds(), process.num_threads()
                found[name] = ProcessSample(process.pid, memory.uss / _MB, in_use_mb, memory.rss / _MB, *pieces)
    return found


def counts(text: str) -> StationCounts:
    """Return what a page of metrics has counted.

    Args:
        text: the page.
    """
    fruit = own_s = whole_s = waiting = 0.0
    images = dict.fromkeys(("kept", "removed"), 0.0)
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            name, labels = sample.name, sample.labels
            if name == "station_inspections_total":
                fruit += sample.value
            elif name == "station_phase_duration_seconds_sum" and labels["phase"].startswith(OWN_PHASES):
                own_s += sample.value
            elif name == "station_inspection_duration_seconds_sum":
                whole_s += sample.value
            elif name == "station_records_images_total" and labels["result"] in images:
                images[labels["result"]] += sample.value
            elif name == "station_outbox_waiting":
                waiting += sample.value
    return StationCounts(fruit, own_s, whole_s, images["kept"], images["removed"], waiting)


def scrape(url: str) -> str:
    """Return the metrics' page.

    Args:
        url: its address.
    """
    with urllib.request.urlopen(url, timeout=10) as answer:
        return answer.read().decode()


def size_mb(folder: Path, pattern: str) -> float:
    """Return the size of files in a folder, of which some may go meanwhile.

    Args:
        folder: where.
        pattern: of their names.
    """
    size = 0
    for path in folder.glob(pattern):
        with contextlib.suppress(FileNotFoundError):
            size += path.stat().st_size
    return size / _MB
