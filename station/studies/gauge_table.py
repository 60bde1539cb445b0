"""Measurement table of a gauge study, read from and written to CSV."""

import csv
import math
from collections.abc import Iterator, Sequence
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from station.errors import BadInputError
from station.studies.agreement import Decisions

COLUMNS = ("part", "operator", "repeat", "area_mm2", "outcome", "reference")
_NEEDED = COLUMNS[:4]
_OUTCOMES = ("PASS", "FAIL", "NO_RESULT")
_LARGEST_BYTES = 4 << 20
_LONGEST_NAME = 40


class Measurement(NamedTuple):
    """One measurement of one part."""

    part: str
    operator: str
    repeat: str
    area_mm2: float
    outcome: str = ""
    """PASS, FAIL or NO_RESULT; empty if it was not recorded."""
    reference: str = ""
    """PASS for a part known to be good, FAIL for a damaged one; empty if unknown."""


class Crossed(NamedTuple):
    """Complete crossed table of measurements."""

    parts: tuple[str, ...]
    operators: tuple[str, ...]
    areas_mm2: npt.NDArray[np.float64]
    """Shape (parts, operators, repeats)."""
    passed: Decisions | None
    """Same shape; None if an outcome is missing."""
    good: npt.NDArray[np.bool_] | None
    """Shape (parts,); None if a reference is missing."""


def crossed(measurements: Sequence[Measurement], place: str) -> Crossed:
    """Order measurements by part and operator; repeats keep their order. `place` names their source in messages.

    Raises:
        BadInputError: not every operator measured every part equally often, at least two of each; or a part has two
            references.
    """
    parts = tuple(dict.fromkeys(one.part for one in measurements))
    operators = tuple(dict.fromkeys(one.operator for one in measurements))
    cells: dict[tuple[str, str], list[Measurement]] = {(p, o): [] for p in parts for o in operators}
    for one in measurements:
        cells[one.part, one.operator].append(one)
    repeats = max((len(cell) for cell in cells.values()), default=0)
    if len(parts) < 2 or len(operators) < 2 or repeats < 2:
        raise BadInputError(
            f"{place}: expected at least 2 parts, 2 operators and 2 repeats, got {len(parts)}, {len(operators)} and "
            f"{repeats}"
        )
    short = [(key, len(cell)) for key, cell in cells.items() if len(cell) != repeats]
    if short:
        (part, operator), number = short[0]
        raise BadInputError(
            f"{place}: expected {repeats} measurements of every part by every operator, got {number} of part {part} by "
            f"operator {operator}; measure what is missing, or take the part out"
        )
    areas = np.array([[[m.area_mm2 for m in cells[p, o]] for o in operators] for p in parts])
    outcomes = np.array([[[m.outcome for m in cells[p, o]] for o in operators] for p in parts])
    references = {part: {m.reference for o in operators for m in cells[part, o]} for part in parts}
    doubled = [part for part, found in references.items() if len(found) > 1]
    if doubled:
        raise BadInputError(f"{place}: expected one reference for each part, got several for part {doubled[0]}")
    known = all(found != {""} for found in references.values())
    return Crossed(
        parts,
        operators,
        areas,
        (outcomes == "PASS") if (outcomes != "").all() else None,
        np.array([references[part] == {"PASS"} for part in parts]) if known else None,
    )


def read_measurements(path: Path) -> list[Measurement]:
    """Read a UTF-8 file with the columns `part,operator,repeat,area_mm2` and, where known, `outcome` and `reference`.

    Raises:
        BadInputError: it cannot be read, or a line is invalid; the message names the line.
    """
    try:
        if path.stat().st_size > _LARGEST_BYTES:
            raise BadInputError(f"{path}: expected at most {_LARGEST_BYTES >> 20} MB; is it the right file?")
        # Spreadsheets may begin a file with a byte order mark.
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text in UTF-8"
        raise BadInputError(f"{path}: cannot be read: {reason}") from error
    try:
        rows = list(csv.reader(StringIO(text), strict=True))
    except csv.Error as error:
        raise BadInputError(f"{path}: is not a CSV file: {error}") from error
    header = [name.strip() for name in rows[0]] if rows else []
    missing = [name for name in _NEEDED if name not in header]
    strange = [name for name in header if name not in COLUMNS or header.count(name) > 1]
    if missing or strange:
        raise BadInputError(
            f"{path}:1: expected the columns {','.join(_NEEDED)} and, where known, outcome,reference; "
            + (f"{', '.join(missing)} is missing" if missing else f"{strange[0]!r} is none of them or there twice")
        )
    return list(_read_rows(path, header, rows[1:]))


def _read_rows(path: Path, header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[Measurement]:
    seen: dict[tuple[str, str, str], int] = {}
    for line, row in enumerate(rows, start=2):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise BadInputError(f"{path}:{line}: expected {len(header)} columns, got {len(row)}")
        cells = {name: cell.strip() for name, cell in zip(header, row, strict=True)}
        for name in _NEEDED[:3]:
            if not 1 <= len(cells[name]) <= _LONGEST_NAME:
                raise BadInputError(f"{path}:{line}: {name}: expected a name of 1 to {_LONGEST_NAME} characters")
        key = cells["part"], cells["operator"], cells["repeat"]
        if key in seen:
            raise BadInputError(f"{path}:{line}: the same part, operator and repeat as in line {seen[key]}")
        seen[key] = line
        outcome, reference = cells.get("outcome", ""), cells.get("reference", "")
        if outcome not in ("", *_OUTCOMES):
            raise BadInputError(f"{path}:{line}: outcome: expected one of {', '.join(_OUTCOMES)}, got {outcome[:40]!r}")
        if reference not in ("", *_OUTCOMES[:2]):
            raise BadInputError(f"{path}:{line}: reference: expected PASS or FAIL, got {reference[:40]!r}")
        yield Measurement(*key, _area(path, line, cells["area_mm2"]), outcome, reference)


def _area(path: Path, line: int, text: str) -> float:
    try:
        area_mm2 = float(text)
    except ValueError:
        area_mm2 = math.nan
    if not 0 <= area_mm2 < math.inf:
        raise BadInputError(f"{path}:{line}: area_mm2: expected a number from 0 up, got {text[:40]!r}")
    return area_mm2


def written(measurements: Sequence[Measurement]) -> bytes:
    """Return the same file's content, with a row for each in this order."""
    text = StringIO(newline="")
    table = csv.writer(text)
    table.writerow(COLUMNS)
    for one in measurements:
        table.writerow((*one[:3], f"{one.area_mm2:.4f}", one.outcome, one.reference))
    return text.getvalue().encode()
