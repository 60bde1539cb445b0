"""A year of a fleet's metrics in Prometheus, and the dashboard Fleet's queries on it."""

import random
import statistics
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

from station.inspection.alarm_table import ALARMS

HOUR_S, DAY_S = 3600, 86_400
STEP_S = 240
"""Between two samples, below Prometheus' lookback of 5 minutes; as deployed 15 s, and 60 s for recorded series."""
BLOCK_S = 486 * HOUR_S
"""As promtool makes the longest block that Prometheus keeps at 400 days of retention, a tenth: 2 h * 3^5."""
POINTS = 640
"""Of a curve: Grafana queries one a pixel, and the board's panels are a third of a screen of 1920 wide."""
RUNS = 5
NOW_ONLY = "station_alarms_active"
"""Queried at one moment alone, so only its last day is made: it is two thirds of all series."""
FRUITS = ("strawberry", "raspberry", "blueberry")

Gauge = tuple[str, dict[str, str], float, float]
"""Name, labels, mean, and the spread of its noise; 0 for what stays."""


class Timed(NamedTuple):
    """One query's times over one range, s."""

    panel: str
    range: str
    median_s: float
    worst_s: float
    series: int


def gauges(station: str) -> Iterator[Gauge]:
    """Yield the metrics of one station that the dashboard Fleet queries: scraped, or as the rules record them."""
    scraped = {"job": "station", "instance": station, "station": station}
    recorded = {"station": station}
    yield "up", scraped, 1.0, 0.0
    yield "station_ready", scraped, 1.0, 0.0
    yield "station_build_info", scraped | {"version": "0.1.0", "python": "3.11.7"}, 1.0, 0.0
    for alarm, row in ALARMS.items():
        yield NOW_ONLY, scraped | {"priority": str(row.priority), "id": alarm}, 0.0, 0.0
    for priority in sorted({str(row.priority) for row in ALARMS.values()}):
        yield "station_priority:alarms_active:sum", recorded | {"priority": priority}, 1.0, 0.0
    yield "station_reference_drift_grey_levels", scraped, 4.0, 1.0
    yield "station_records_free_bytes", scraped, 4e11, 1e10
    yield "station_outbox_lag_seconds", scraped | {"destination": "postgresql"}, 0.5, 0.2
    yield "station_outbox_lag_seconds", scraped | {"destination": "mqtt"}, 0.5, 0.2
    yield "station_calibration_age_seconds", scraped, 1e6, 1e5
    yield "station:inspections:rate15m", recorded, 0.3, 0.06
    for fruit in FRUITS:
        for name in ("reject_ratio:1h", "unjudged_ratio:1h", "cycle_share:p95_15m"):
            yield f"station_fruit:{name}", recorded | {"fruit": fruit}, 0.1, 0.02


def write_block(file: Path, stations: Sequence[str], begin_s: int, end_s: int, year_end_s: int) -> int:
    """Write a time of all stations' series as OpenMetrics.

    Args:
        file: for it.
        stations: their names.
        begin_s: from when, seconds since 1970, likewise the others.
        end_s: until when.
        year_end_s: of all the history.

    Returns:
        The number of samples.
    """
    drawn = random.Random(begin_s)
    # A prime number of them, each used again and again: to draw 40 million would take a minute.
    noise = [drawn.gauss(0.0, 1.0) for _ in range(10_007)]
    families: dict[str, list[tuple[dict[str, str], float, float]]] = {}
    for station in stations:
        for name, labels, mean, spread in gauges(station):
            families.setdefault(name, []).append((labels, mean, spread))
    written = 0
    with file.open("w", encoding="utf-8") as text:
        for name, several in families.items():
            text.write(f"# TYPE {name} gauge\n")
            times = range(max(begin_s, year_end_s - DAY_S) if name == NOW_ONLY else begin_s, end_s, STEP_S)
            for labels, mean, spread in several:
                series = name + "{" + ",".join(f'{key}="{value}"' for key, value in labels.items()) + "}"
                first = drawn.randrange(len(noise))
                text.writelines(
                    f"{series} {mean + spread * noise[(first + number) % len(noise)]:.9g} {at_s}\n"
                    for number, at_s in enumerate(times)
                )
                written += len(times)
        text.write("# EOF\n")
    return written


def blocks(end_s: int, days: int) -> Iterator[tuple[int, int]]:
    """Begin and end of each block of the days before a time, aligned as Prometheus has them."""
    begin_s = end_s - days * DAY_S
    edges = [begin_s, *range((begin_s // BLOCK_S + 1) * BLOCK_S, end_s, BLOCK_S), end_s]
    yield from pairwise(edges)


def measure(prometheus: Any, queries: Sequence[tuple[str, str, bool]], end_s: int) -> Iterator[Timed]:
    """Time each query over a day, a month and a year.

    Args:
        prometheus: with the year.
        queries: panel, PromQL, and whether it is a curve and not a moment's number.
        end_s: the year's end.
    """
    for panel, expr, over_time in queries:
        for name, days in (("day", 1), ("month", 30), ("year", 365)):
            begin_s = end_s - days * DAY_S
            took_s, found = [], []
            for _ in range(RUNS):
                began_s = time.perf_counter()
                if over_time:
                    found = prometheus.over(expr, begin_s, end_s, (end_s - begin_s) / POINTS)
                else:
                    found = prometheus.now(expr, end_s)
                took_s.append(time.perf_counter() - began_s)
            yield Timed(panel, name, statistics.median(took_s), max(took_s), len(found))
