"""Recent inspections restored from the records after a start."""

import json
import sqlite3
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from sqlalchemy import Connection

from station.channel.line import Outcome
from station.channel.panel_run import FruitSummary
from station.errors import StationError
from station.messages import records as messages
from station.records.database import plain, reading
from station.records.errors import RecordsError
from station.records.model import FullRecord, StoredImage
from station.records.queries import read_inspection
from station.runtime.rpc.recent_inspections import (
    MOST_IN_FULL,
    MOST_IN_SHORT,
    ReadStep,
    RecentFruit,
    deciding_step,
    fruit_view,
    short_view,
)
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import parse_recipe
from station.vision.contact import Image

_LAST = (
    "SELECT i.sequence, i.standing, coalesce(r.name, 'none'), i.lot FROM inspections AS i "
    "LEFT JOIN recipe_snapshots AS r ON r.sha256 = i.recipe_sha256 "
    "WHERE i.standing NOT NULL ORDER BY i.sequence DESC LIMIT ?"
)
_AREAS = (
    "SELECT sequence, area_mm2 FROM curve_points WHERE closing_mm >= 0 "
    "AND sequence IN (SELECT value FROM json_each(?)) ORDER BY sequence, step"
)
_COUNTS = (
    "SELECT outcome, count(*) FROM inspections INDEXED BY ix_inspections_lot_outcome "
    "WHERE lot = ? AND outcome NOT NULL AND sequence < ? GROUP BY outcome"
)


class RestoredInspections(NamedTuple):
    """Arguments of `RecentInspections.restore`."""

    short: tuple[FruitSummary, ...]
    full: tuple[RecentFruit, ...]
    lots: dict[str, Counter[str]]


def read_recent(folder: Path, deadline_s: Callable[[Recipe], float]) -> RestoredInspections:
    """Read the recent inspections, and the counts of their lots. Blocks for some tens of milliseconds.

    Args:
        deadline_s: returns the longest duration of an inspection by a recipe.

    Raises:
        RecordsError: the records cannot be read.
    """
    with reading(folder) as connection:
        database = plain(connection)
        rows = database.execute(_LAST, (MOST_IN_SHORT,)).fetchall()[::-1]
        areas: dict[int, list[float | None]] = {row[0]: [] for row in rows}
        for sequence, area_mm2 in database.execute(_AREAS, (json.dumps(list(areas)),)):
            areas[sequence].append(area_mm2)
        short = tuple(
            short_view(_of_lot(Outcome.model_validate_json(row[1]), row[3]), row[2], areas[row[0]]) for row in rows
        )
        full = (_full(connection, folder, each.sequence, deadline_s) for each in short[-MOST_IN_FULL:])
        named = list(dict.fromkeys(each.lot for each in reversed(short) if each.lot))[:MOST_IN_FULL]
        lots = {lot: _counts(database, lot, short[-1].sequence + 1) for lot in reversed(named)}
        return RestoredInspections(short, tuple(each for each in full if each is not None), lots)


def read_counts(folder: Path, lot: str, below: int) -> Counter[str]:
    """Read the counts of a lot's outcomes, of its fruit below a sequence. Blocks for some milliseconds.

    Raises:
        RecordsError: the records cannot be read.
    """
    with reading(folder) as connection:
        return _counts(plain(connection), lot, below)


def _counts(database: sqlite3.Connection, lot: str, below: int) -> Counter[str]:
    return Counter(dict(database.execute(_COUNTS, (lot, below)).fetchall()))


def _full(
    connection: Connection, folder: Path, sequence: int, deadline_s: Callable[[Recipe], float]
) -> RecentFruit | None:
    """Return a fruit in full; None if it is not known in full, as one that a crash ended."""
    record = read_inspection(connection, sequence, folder)
    snapshot, judged = record.trigger.recipe, record.judged
    if snapshot is None or judged is None or record.standing is None:
        return None
    try:
        recipe = parse_recipe(snapshot.text, f"inspection@{sequence}")
        limit_s = deadline_s(recipe)
    except StationError:  # of another schema version, or longer than this cell may take
        return None
    step = deciding_step(judged)
    look = None if step is None else _step_reader(record, step)
    standing = _of_lot(record.standing, record.trigger.lot)
    fruit = fruit_view(standing, judged, recipe, snapshot.revision, limit_s, None if look is None else step)
    return RecentFruit(fruit, look)


def _of_lot(outcome: Outcome, lot: str) -> Outcome:
    """Return an outcome with its trigger's lot: one of the PLC interface's own has none where the panel named it."""
    return outcome.model_copy(update={"lot": lot})


def _step_reader(record: FullRecord, step: int) -> ReadStep | None:
    """Return a reader of the image; None if no image was stored."""
    kept = {image.kind: image for image in record.images if image.step == step}
    image, mask = kept.get("step"), kept.get("mask")
    if image is None or mask is None:
        return None

    def read_images() -> tuple[Image, Image]:
        return _read(image, cv2.IMREAD_COLOR), _read(mask, cv2.IMREAD_GRAYSCALE)

    return read_images


def _read(image: StoredImage, flag: int) -> Image:
    picture = cv2.imread(image.path, flag)
    if picture is None:
        raise RecordsError(messages.IMAGE_GONE(), messages.OLDEST_GO_FIRST())
    return np.asarray(picture, np.uint8)
