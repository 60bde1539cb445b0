"""Many inspections, written straight into a database of the records' form: a season in a minute."""

import json
from collections.abc import Iterator
from pathlib import Path

from station.records.database import FILE_NAME, open_engine, plain
from station.records.migration import migrate
from station.records.search_index import HOUR_MS
from station.vocabulary import Reason

FIRST_UTC_MS = 1_767_225_600_000
"""2026-01-01."""
PERIOD_MS = 3_000
LOT_SIZE = 2_000
GROWERS = 40
_RECIPES = {"strawberry": "5" * 64, "raspberry": "7" * 64}
RARE_FRUIT_LOT = 200
"""Every so-manieth lot is of the rarer fruit."""
_BATCH = 20_000
_UNMEASURED = (Reason.NO_CONTACT, Reason.LOW_CONFIDENCE, Reason.SATURATED, Reason.IMAGE_STALE)

_INSPECTION = (
    "INSERT INTO inspections (sequence, boot, trigger_id, encoder, lot, recipe_sha256, recipe_number, recipe_checksum, "
    "simulated, began_utc_ms, ended_utc_ms, duration_ms, judged, reasons, explanation, late, partial, area_mm2, "
    "area_px, closing_mm, confidence, phases_s, measures, devices, versions, images_state, outcome, standing, "
    "published_utc_ms, "
    "acknowledged_utc_ms) VALUES (?, 'boot', ?, 0, ?, ?, 3, 1, 0, ?, ?, 3000, ?, ?, '[]', 0, 0, ?, 40000, 4.0, 0.9, "
    '\'{"approach":0.8,"steps":2.1}\', \'{}\', \'{"camera":"DIGIT D20966"}\', \'{"fruit-station":"0.1.0"}\', '
    "'not wanted', ?, ?, ?, ?)"
)


def made(number: int) -> tuple[str, str, tuple[str, ...]]:
    """The lot, outcome and reasons of an inspection, the same every time.

    Args:
        number: its sequence.
    """
    chance = number * 2_654_435_761 % 2**32 / 2**32  # Knuth, The Art of Computer Programming, vol. 3, section 6.4
    lot = f"L{number // LOT_SIZE:05d}"
    if number % 100_000 == 7:
        return lot, "NO_RESULT", (Reason.CAMERA_FAULT,)
    if chance < 0.92:
        return lot, "PASS", ()
    if chance < 0.98:
        return lot, "FAIL", (Reason.AREA_OVER_LIMIT, *((Reason.EARLY_STOP,) if chance < 0.95 else ()))
    return lot, "NO_RESULT", (_UNMEASURED[int(chance * 1e6) % len(_UNMEASURED)],)


def fruit_of(number: int) -> str:
    """Return the kind of fruit of an inspection.

    Args:
        number: its sequence number.
    """
    return "strawberry" if number // LOT_SIZE % RARE_FRUIT_LOT else "raspberry"


def grower_of(lot: str) -> str:
    """Whose lot it is."""
    return f"grower {int(lot[1:]) * 7 % GROWERS}"


def fill(folder: Path, first: int, last: int, steps: int) -> None:
    """Write the inspections with these numbers, published and acknowledged, with lots and outbox.

    Args:
        folder: the records' folder, made where missing.
        first: the first number.
        last: the last number.
        steps: points of each curve.
    """
    folder.mkdir(parents=True, exist_ok=True)
    engine = open_engine(folder / FILE_NAME, "rwc")
    try:
        migrate(engine, folder)
        with engine.connect() as connection:
            database = plain(connection)
            database.execute("PRAGMA synchronous = OFF")
            for start in range(first, last + 1, _BATCH):
                numbers = range(start, min(start + _BATCH, last + 1))
                database.execute("BEGIN IMMEDIATE")
                database.executemany(
                    "INSERT OR IGNORE INTO recipe_snapshots VALUES (?, ?, 3, '1', 1, '{}')",
                    [(sha256, name) for name, sha256 in _RECIPES.items()],
                )
                for lot in sorted({made(number)[0] for number in (numbers[0], numbers[-1])} | set(_lots(numbers))):
                    database.execute(
                        "INSERT OR IGNORE INTO lots (name, grower, began_utc_ms, revision) VALUES (?, ?, ?, 1)",
                        (lot, grower_of(lot), _began(numbers[0])),
                    )
                database.executemany(_INSPECTION, _rows(numbers))
                reasons = ((why, outcome, n) for n in numbers for _, outcome, all_ in [made(n)] for why in all_)
                database.executemany("INSERT INTO reasons VALUES (?, ?, ?)", reasons)
                points = ((n, s, 30.0 - s, float(s), 8.0 * s, 11_000 * s) for n in numbers for s in range(steps))
                database.executemany(
                    "INSERT INTO curve_points (sequence, step, width_mm, closing_mm, area_mm2, area_px, confidence, "
                    "flags) VALUES (?, ?, ?, ?, ?, ?, 0.9, '[]')",
                    points,
                )
                hours = ((n, _began(n) // HOUR_MS) for n in numbers if n == 1 or _hour(n) != _hour(n - 1))
                database.executemany("INSERT OR IGNORE INTO hours VALUES (?, ?)", hours)
                database.executemany(
                    "INSERT INTO outbox (kind, row) VALUES ('inspection', ?)", ((number,) for number in numbers)
                )
                database.execute("COMMIT")
    finally:
        engine.dispose()


def _lots(numbers: range) -> Iterator[str]:
    for number in range(numbers[0], numbers[-1] + 1, LOT_SIZE):
        yield made(number)[0]


def _began(number: int) -> int:
    return FIRST_UTC_MS + number * PERIOD_MS


def _hour(number: int) -> int:
    return _began(number) // HOUR_MS


def _rows(numbers: range) -> Iterator[tuple[object, ...]]:
    for number in numbers:
        lot, outcome, reasons = made(number)
        area = 20.0 + number % 60
        outcome_json = json.dumps({
            "sequence": number, "trigger_id": number % 65_535 + 1, "outcome": outcome, "reasons": reasons,
            "late": False, "partial": False, "simulated": False, "area_mm2": area, "area_px": 40_000, "closing_mm": 4.0,
            "confidence": 0.9, "recipe_number": 3, "recipe_checksum": 1, "began_utc_ms": _began(number),
            "ended_utc_ms": _began(number) + 2900, "duration_ms": 3000, "encoder": 0, "lot": lot,
        })  # fmt: skip
        yield (
            number, number % 65_535 + 1, lot, _RECIPES[fruit_of(number)], _began(number), _began(number) + 2900,
            outcome, json.dumps(reasons), area, outcome, outcome_json, _began(number) + 2950, _began(number) + 3000,
        )  # fmt: skip
