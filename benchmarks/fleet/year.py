"""A year of a fleet in PostgreSQL, made there by a series, and the dashboard Quality's queries on it."""

import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from typing import Any, NamedTuple

from . import plain

FIRST_DAY = datetime(2025, 3, 3, tzinfo=UTC)
A_MINUTE = 18
"""Each station's full pace, docs/line-pace.md."""
HOURS = 8
"""A shift a day, as docs/sizing.md plans with."""
LOT_SIZE = 2_000
GROWERS = 40
FRUITS = ("strawberry", "raspberry", "blueberry")
RUNS = 5
_LOADERS = 2
_PLAIN_LIMIT_S = 120

_MAKE_LOTS = """
INSERT INTO lots SELECT 'station-' || station, 'L' || lpad(lot::text, 5, '0'),
    'grower ' || (lot * 7 + station) % {growers}, '{day}'::timestamptz, NULL, 1, 'bench', lot
FROM generate_series(1, {stations}) AS station, generate_series(0, {lots}) AS lot
"""
# One day of all stations. Outcomes in the shares of benchmarks/archive/many.py; areas log-normal about a station's own
# mean that falls with the season, by Box and Muller's transform of two uniform numbers.
_MAKE_DAY = """
INSERT INTO inspections (station, sequence, began, ended, duration_ms, published, lot, fruit, recipe_sha256, outcome,
    reasons, judged, explanation, late, partial, simulated, area_mm2, area_px, closing_mm, confidence, trigger_id,
    encoder, boot, curve, images, images_state, phases_s, measures, devices, versions, origin, entry)
SELECT 'station-' || station, sequence, began, began + duration_ms * interval '1 ms', duration_ms,
    began + duration_ms * interval '1 ms', 'L' || lpad((sequence / {lot_size})::text, 5, '0'), fruit,
    repeat(md5(fruit), 2), outcome,
    CASE outcome WHEN 'PASS' THEN '{{}}'::text[] WHEN 'FAIL' THEN
        CASE WHEN chance < 0.95 THEN '{{area_over_limit,early_stop}}'::text[] ELSE '{{area_over_limit}}' END
    ELSE
        ARRAY[(ARRAY['no_contact', 'low_confidence', 'saturated', 'image_stale'])[1 + (chance * 1e6)::integer % 4]]
    END,
    outcome, '{{}}', false, false, false,
    CASE WHEN outcome <> 'NO_RESULT' THEN area_mm2 END, 40000, 4.0, 0.9, sequence % 65535 + 1, sequence * 100,
    'boot', '{curve}', '[]', 'not wanted', '{{"approach": 0.8, "steps": 2.1}}', '{{}}',
    '{{"camera": "DIGIT D20966"}}', '{{"fruit-station": "0.1.0"}}', 'bench', sequence
FROM (
    SELECT station, sequence, chance,
        '{day}'::timestamptz + (6 + (number + station / 20.0) / {an_hour}) * interval '1 hour' AS began,
        (2700 + 300 * random() + 20 * station)::bigint AS duration_ms,
        (ARRAY['strawberry', 'raspberry', 'blueberry'])[1 + number * 3 / {a_day}] AS fruit,
        CASE WHEN chance < 0.92 THEN 'PASS' WHEN chance < 0.98 THEN 'FAIL' ELSE 'NO_RESULT' END AS outcome,
        (40 + station - 0.05 * {day_number}) * exp(
            0.25 * sqrt(-2 * ln(1 - random())) * cos(2 * pi() * random())
        ) AS area_mm2
    FROM (
        SELECT station, number, {day_number}::bigint * {a_day} + number AS sequence, random() AS chance
        FROM generate_series(0, {a_day} - 1) AS number, generate_series(1, {stations}) AS station
    ) AS drawn
) AS made
"""
_CURVE = (
    '[{"step": 0, "width_mm": 30.0, "closing_mm": 1.0, "area_mm2": 8.0}, '
    '{"step": 1, "width_mm": 29.0, "closing_mm": 2.0, "area_mm2": 16.0}, '
    '{"step": 2, "width_mm": 28.0, "closing_mm": 3.0, "area_mm2": 24.0}, '
    '{"step": 3, "width_mm": 27.0, "closing_mm": 4.0, "area_mm2": 32.0}]'
)


class Timed(NamedTuple):
    """One query's times over one range, s."""

    panel: str
    range: str
    median_s: float
    worst_s: float
    plain_s: float | None
    """The same question put to the inspections; None where it is the same statement."""
    same: bool
    """Whether both gave the same answer."""


def load(server: Any, stations: int, days: int, on_day: Callable[[], None]) -> int:
    """Make the days of a season, through the schema's triggers.

    Args:
        server: with the deployed schema.
        stations: how many.
        days: of the season.
        on_day: called after each.

    Returns:
        The number of inspections.
    """
    an_hour = A_MINUTE * 60
    numbers = {
        "stations": stations, "lot_size": LOT_SIZE, "an_hour": an_hour, "a_day": HOURS * an_hour, "growers": GROWERS,
        "lots": days * HOURS * an_hour // LOT_SIZE, "curve": _CURVE,
    }  # fmt: skip

    def make(some: Sequence[int]) -> None:
        with server.connect() as connection:
            for day in some:
                connection.execute("SELECT setseed(%s)", (day / days,))
                at = (FIRST_DAY + timedelta(days=day)).isoformat()
                connection.execute(_MAKE_DAY.format(day=at, day_number=day, **numbers))
                on_day()

    with server.connect() as connection:
        connection.execute(_MAKE_LOTS.format(day=FIRST_DAY.isoformat(), **numbers))
        for number, fruit in enumerate(FRUITS, 1):
            values = "(repeat(md5(%s), 2), %s, %s, '1', '{}')"
            connection.execute(f"INSERT INTO recipes VALUES {values}", (fruit, fruit, number))
        with ThreadPoolExecutor(_LOADERS) as pool:
            list(pool.map(make, (range(first, days, _LOADERS) for first in range(_LOADERS))))
        last = days * HOURS * an_hour
        connection.execute(
            "INSERT INTO stations SELECT 'station-' || number, 'bench', %s FROM generate_series(1, %s) AS number",
            (last, stations),
        )
        connection.execute("VACUUM ANALYZE")
    return stations * last


def ranges(days: int) -> dict[str, tuple[str, str]]:
    """Begin and end of the season's last day, its last 30 days, and the year that ends with it."""
    end = FIRST_DAY + timedelta(days=days)
    last = (end - timedelta(microseconds=1)).isoformat()
    return {
        name: ((end - timedelta(days=length)).isoformat(), last)
        for name, length in (("day", 1), ("month", 30), ("year", 365))
    }


def measure(
    server: Any, queries: dict[str, str], days: int, stations: int, expand: Callable[..., str]
) -> Iterator[Timed]:
    """Time each query over each range, and compare it with the plain statement's time and answer.

    Args:
        server: with the season.
        queries: by the panel's title, with Grafana's macros.
        days: of the season.
        stations: how many.
        expand: `monitoring.queries.sql`.
    """
    chosen = {"station": [f"station-{number}" for number in range(1, stations + 1)], "fruit": list(FRUITS)}
    with server.connect() as connection:
        connection.execute(f"SET statement_timeout = '{_PLAIN_LIMIT_S}s'; SET timezone = 'UTC'")
        for panel, query in queries.items():
            for name, (begin, end) in ranges(days).items():
                took_s = []
                rows: list[Any] = []
                for _ in range(RUNS):
                    rows, each_s = timed(connection, expand(query, begin, end, **chosen))
                    took_s.append(each_s)
                plain_s, same = None, True
                if panel in plain.STATEMENTS:
                    other, plain_s = timed(connection, expand(plain.STATEMENTS[panel], begin, end, **chosen))
                    same = equal(rows, other, plain.MEDIAN_TOLERANCE if panel in plain.MEDIANS else 1e-9)
                yield Timed(panel, name, statistics.median(took_s), max(took_s), plain_s, same)


def timed(connection: Any, statement: str) -> tuple[list[Any], float]:
    """A statement's rows, and how long until they were here, s."""
    began_s = time.perf_counter()
    rows = connection.execute(statement.encode()).fetchall()
    return rows, time.perf_counter() - began_s


def equal(some: Sequence[Any], others: Sequence[Any], tolerance: float) -> bool:
    """Return whether two results have the same rows in any order, their floats equal to a relative tolerance."""

    def keyed(rows: Sequence[Any]) -> dict[tuple[Any, ...], list[float]]:
        return {
            tuple(cell for cell in row if not isinstance(cell, float)): [c for c in row if isinstance(c, float)]
            for row in rows
        }

    ours, theirs = keyed(some), keyed(others)
    return (
        len(some) == len(others)
        and ours.keys() == theirs.keys()
        and all(
            len(mine) == len(theirs[key])
            and all(math.isclose(one, other, rel_tol=tolerance) for one, other in zip(mine, theirs[key], strict=True))
            for key, mine in ours.items()
        )
    )
