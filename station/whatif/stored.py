"""Stored inspections as plain values that another process, or another machine, can judge again."""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from sqlalchemy import Connection

from station.inspection.fruit_size import FruitSize
from station.inspection.press import Measured, Press
from station.inspection.second_press import together
from station.messages.judge import STEPS_ENDED
from station.messages.message import Message
from station.records.first_press import first_press
from station.records.images import image_path
from station.records.stored_message import from_stored
from station.vocabulary import Flag, OutcomeName, Reason

USUAL_ONSET_UNCERTAINTY_MM = 0.4
"""Default of the gripper's count, the step of the onset search; for records without their own."""
_FLAGS = {flag.value for flag in Flag}
_NO_FLAGS: frozenset[Flag] = frozenset()
_INTERRUPTIONS = frozenset(
    {
        Reason.IMAGE_STALE,
        Reason.LATE,
        Reason.CALLED_OFF,
        Reason.ARM_FAULT,
        Reason.GRIPPER_FAULT,
        Reason.CAMERA_FAULT,
        Reason.RECORDS_FAULT,
        Reason.STATION_LOST,
    }
)


@dataclass(frozen=True, slots=True)
class StoredPress:
    """One inspection as it was stored."""

    sequence: int
    lot: str
    before: OutcomeName
    """As the station judged it."""
    recipe_sha256: str
    press: Press
    """The last one, with its points in the order of the steps."""
    gate_factor: float = 1.0
    """Factor by which the sensor's calibration had raised the robust method's gate."""
    images: tuple[tuple[int | None, bytes], ...] = ()
    """PNG by step, None for the reference; only if requested and stored."""
    first: Press | None = None
    """The press before it, which was inconclusive; None if the fruit was pressed once."""

    @property
    def judged(self) -> Press:
        """Return all presses together, as the station judged them."""
        return self.press if self.first is None else together([self.first, self.press])


def sequences(
    connection: Connection,
    name: str,
    lots: Sequence[str],
    last: int | None,
    judged: Sequence[OutcomeName] = ("PASS", "FAIL", "NO_RESULT"),
) -> list[int]:
    """List a recipe's inspections with these outcomes, in order: of some lots or all, the `last` at most or all."""
    marks = ", ".join("?" * len(lots))
    chosen = f"AND i.lot IN ({marks})" if lots else ""
    query = (
        "SELECT i.sequence FROM inspections i JOIN recipe_snapshots r ON r.sha256 = i.recipe_sha256 "  # noqa: S608 (marks)
        f"WHERE r.name = ? AND i.judged IN ({', '.join('?' * len(judged))}) {chosen} ORDER BY i.sequence DESC LIMIT ?"
    )
    found = connection.exec_driver_sql(query, (name, *judged, *lots, -1 if last is None else last))
    return [row[0] for row in found][::-1]


def snapshots(connection: Connection, name: str) -> dict[str, str]:
    """Return the recipe's stored versions, canonical JSON by their hash."""
    found = connection.exec_driver_sql("SELECT sha256, text FROM recipe_snapshots WHERE name = ?", (name,))
    return dict(tuple(row) for row in found)


def snapshots_of(connection: Connection, wanted: Sequence[int]) -> dict[str, str]:
    """Return the recipes that some inspections were judged by, canonical JSON by their hash, by their first fruit.

    Args:
        wanted: their sequences, ascending.
    """
    if not wanted:
        return {}
    judged = connection.exec_driver_sql(
        "SELECT sequence, recipe_sha256 FROM inspections WHERE sequence BETWEEN ? AND ? ORDER BY sequence",
        (wanted[0], wanted[-1]),
    )
    chosen = set(wanted)
    hashes = tuple(dict.fromkeys(sha256 for sequence, sha256 in judged if sequence in chosen))
    marks = ", ".join("?" * len(hashes))
    query = f"SELECT sha256, text FROM recipe_snapshots WHERE sha256 IN ({marks})"  # noqa: S608 (marks)
    texts = dict(tuple(row) for row in connection.exec_driver_sql(query, hashes))
    return {sha256: texts[sha256] for sha256 in hashes}


def read_stored(connection: Connection, wanted: Sequence[int], folder: Path, *, with_images: bool) -> list[StoredPress]:
    """Read some hundred inspections, in ascending order, with their curves, and also their images if wanted."""
    marks = ", ".join("?" * len(wanted))
    rows = connection.exec_driver_sql(
        "SELECT sequence, lot, judged, reasons, explanation, recipe_sha256, measures, fruit_length_mm_x10, "  # noqa: S608 (marks)
        f"size_class FROM inspections WHERE sequence IN ({marks}) ORDER BY sequence",
        tuple(wanted),
    ).all()
    points = connection.exec_driver_sql(
        f"SELECT sequence, closing_mm, area_mm2, area_px, confidence, flags FROM curve_points "  # noqa: S608 (marks)
        f"WHERE sequence IN ({marks}) ORDER BY sequence, step",
        tuple(wanted),
    ).all()
    curves = {sequence: list(curve) for sequence, curve in groupby(points, key=lambda point: point[0])}
    images = _images(connection, wanted, folder) if with_images else {}
    return [_stored(row, curves.get(row[0], []), images.get(row[0], ())) for row in rows]


def _stored(row: Any, curve: Iterable[Any], images: tuple[tuple[int | None, bytes], ...]) -> StoredPress:
    sequence, lot, judged, reasons, explanation, recipe_sha256, measures, length_mm_x10, size_class = row
    found = {Reason(reason) for reason in json.loads(reasons or "[]")}
    measured: dict[str, Any] = json.loads(measures or "{}")
    points = tuple(_points(curve))
    onset_mm = measured.get("onset_mm")
    uncertainty_mm = measured.get("onset_uncertainty_mm", USUAL_ONSET_UNCERTAINTY_MM)
    said = [from_stored(each) for each in json.loads(explanation or "[]")]
    interruptions = tuple(_interruptions(found, points, said))
    press = Press(
        onset_mm,
        uncertainty_mm if onset_mm is not None else 0.0,
        points,
        interruptions,
        # 0 is a size that the PLC did not give, as in its registers.
        FruitSize(length_mm_x10 / 10 or None, size_class or None),
        measured.get("gripper_resolution_mm", 0.0),  # records of before were judged without it
        measured.get("scale_uncertainty", 0.0),
    )
    gate_factor = measured.get("gate_factor") or 1.0
    first = first_press(measured)
    if first is not None:  # of the same fruit, by the same gripper and sensor
        first = replace(
            press,
            onset_mm=first.onset_mm,
            onset_uncertainty_mm=first.onset_uncertainty_mm,
            points=first.points,
            # After an interruption there is no second press.
            interruptions=(),
        )
    return StoredPress(sequence, lot, judged, recipe_sha256, press, gate_factor, images, first)


def _points(curve: Iterable[Any]) -> Iterator[Measured]:
    for _, closing_mm, area_mm2, area_px, confidence, flags in curve:
        if closing_mm is not None and area_mm2 is not None:
            given = json.loads(flags) if flags != "[]" else ()
            known = frozenset(Flag(flag) for flag in given if flag in _FLAGS) if given else _NO_FLAGS
            yield Measured(closing_mm, area_mm2, area_px or 0, confidence, known)


def _interruptions(found: set[Reason], points: Sequence[Measured], said: Sequence[Message]) -> Iterator[Reason]:
    """Return the reasons from outside the measurement; the judge gives the others itself.

    Steps that ended for no known reason are the judge's finding; any other internal fault is one of the program. A
    record of before messages does not tell them apart, and counts as the latter: no draft makes a result of it.
    """
    yield from (reason for reason in Reason if reason in found & _INTERRUPTIONS)
    mismatch = any(Flag.REFERENCE_MISMATCH in point.flags for point in points)
    if Reason.REFERENCE_BAD in found and not mismatch:
        yield Reason.REFERENCE_BAD
    if Reason.INTERNAL_FAULT in found and not any(message.id == STEPS_ENDED.id for message in said):
        yield Reason.INTERNAL_FAULT


def _images(
    connection: Connection, wanted: Sequence[int], folder: Path
) -> dict[int, tuple[tuple[int | None, bytes], ...]]:
    marks = ", ".join("?" * len(wanted))
    rows = connection.exec_driver_sql(
        f"SELECT sequence, kind, step, sha256 FROM images WHERE sequence IN ({marks}) "  # noqa: S608 (marks)
        "AND kind IN ('reference', 'step') ORDER BY sequence, id",
        tuple(wanted),
    ).all()
    found: dict[int, list[tuple[int | None, bytes]]] = {}
    for sequence, kind, step, sha256 in rows:
        try:
            data = Path(image_path(folder, sha256)).read_bytes()
        # The image store may have removed it for its quota; `remeasured` reports an image that is missing.
        except OSError:
            continue
        found.setdefault(sequence, []).append((None if kind == "reference" else step, data))
    return {sequence: tuple(images) for sequence, images in found.items()}
