"""Export of inspections as a table for other programs: CSV or Parquet, written in constant memory."""

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from station.records.csv_cell import csv_cell
from station.records.database import plain, reading
from station.records.error_mapping import map_error
from station.records.high_water_mark import LARGEST
from station.records.search import Query

WINDOW = 10_000
"""Sequence numbers read in one transaction, and rows of one Parquet row group at most."""

_LIST = "(SELECT json_group_array({0}) FROM (SELECT {0} FROM {1} WHERE {1}.sequence = i.sequence ORDER BY {2}))"
_OUTCOME = "json_extract(i.standing, '$.{}')"
"""Of the outcome that the PLC got, as other systems get it; the judgement's may differ where that came too late."""
_TIME = pa.timestamp("ms", tz="UTC")


class Column(NamedTuple):
    """One column of the table."""

    name: str
    kind: pa.DataType
    sql: str


COLUMNS = (
    Column("sequence", pa.int64(), "i.sequence"),
    Column("began", _TIME, "i.began_utc_ms"),  # when the trigger was accepted
    Column("ended", _TIME, _OUTCOME.format("ended_utc_ms")),
    Column("duration_ms", pa.int64(), f"nullif({_OUTCOME.format('duration_ms')}, 0)"),  # by the monotonic clock
    Column("trigger_id", pa.int64(), "i.trigger_id"),
    Column("encoder", pa.int64(), "i.encoder"),
    Column("lot", pa.string(), "i.lot"),
    Column("grower", pa.string(), "l.grower"),
    Column("fruit", pa.string(), "r.name"),  # the recipe's name
    Column("recipe_sha256", pa.string(), "i.recipe_sha256"),
    Column("outcome", pa.string(), "i.outcome"),  # for the PLC; empty while the inspection runs
    Column("reasons", pa.list_(pa.string()), _OUTCOME.format("reasons")),  # of the outcome, the deciding one first
    Column("judged", pa.string(), "i.judged"),  # the station's own judgement
    Column("area_mm2", pa.float64(), _OUTCOME.format("area_mm2")),  # the contact area that decided
    Column("area_px", pa.int64(), _OUTCOME.format("area_px")),
    Column("closing_mm", pa.float64(), _OUTCOME.format("closing_mm")),
    Column("confidence", pa.float64(), _OUTCOME.format("confidence")),
    Column("late", pa.bool_(), _OUTCOME.format("late")),  # after the deadline
    Column("partial", pa.bool_(), _OUTCOME.format("partial")),  # before the recipe's last step
    Column("simulated", pa.bool_(), "i.simulated"),
    Column("published", _TIME, "i.published_utc_ms"),
    Column("acknowledged", _TIME, "i.acknowledged_utc_ms"),
    Column("closings_mm", pa.list_(pa.float64()), _LIST.format("closing_mm", "curve_points", "step")),
    Column("areas_mm2", pa.list_(pa.float64()), _LIST.format("area_mm2", "curve_points", "step")),
    Column("images", pa.list_(pa.string()), _LIST.format("sha256", "images", "id")),  # SHA-256 of the stored images
    Column("changed_areas_mm2", pa.list_(pa.float64()), _LIST.format("changed_area_mm2", "curve_points", "step")),
    Column("fruit_length_mm", pa.float64(), "nullif(i.fruit_length_mm_x10, 0) / 10.0"),  # 0: the PLC gave none
    Column("size_class", pa.int64(), "nullif(i.size_class, 0)"),
    Column("recipe_revision", pa.string(), "r.revision"),
    # Between the jaws at the first contact; empty where there was none.
    Column("fruit_width_mm", pa.float64(), "CAST(json_extract(i.measures, '$.onset_mm') AS REAL)"),
)
"""A list is JSON text in CSV."""
SCHEMA = pa.schema([pa.field(column.name, column.kind) for column in COLUMNS])
SUFFIXES = (".csv", ".parquet")

Rows = Sequence[Sequence[Any]]


def export(folder: Path, query: Query, target: Path) -> int:
    """Write the inspections that match a query to a file with one of `SUFFIXES`, in order of number; return how many.

    Raises:
        RecordsError: the records cannot be read, or the file not written; then `target` is unchanged.
    """
    partial = target.with_name(f".{target.name}.partial")
    open_writer = _csv_writer if target.suffix == ".csv" else _parquet_writer
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        number = 0
        with open_writer(partial) as write:
            for rows in _windows(folder, query):
                write(rows)
                number += len(rows)
        partial.replace(target)
    except OSError as error:
        raise map_error(error, str(target)) from error
    finally:
        partial.unlink(missing_ok=True)
    return number


def _windows(folder: Path, query: Query) -> Iterator[Rows]:
    """Yield the rows, a window of numbers at a time, so that no reader blocks the truncation of the write-ahead log."""
    where, values = _conditions(query)
    statement = (
        f"SELECT {', '.join(column.sql for column in COLUMNS)} FROM inspections AS i"  # noqa: S608 (of constants)
        " LEFT JOIN recipe_snapshots AS r ON r.sha256 = i.recipe_sha256 LEFT JOIN lots AS l ON l.name = i.lot"
        f" WHERE i.sequence BETWEEN ? AND ?{where} ORDER BY i.sequence"
    )
    with reading(folder) as connection:
        cursor = plain(connection).cursor()
        first, last = cursor.execute(
            "SELECT (SELECT min(sequence) FROM inspections), (SELECT max(sequence) FROM inspections)"
        ).fetchone()
        for start in range(first or 1, (last or 0) + 1, WINDOW):
            rows = cursor.execute(statement, (start, min(start + WINDOW - 1, last, LARGEST), *values)).fetchall()
            if rows:
                yield rows


def _conditions(query: Query) -> tuple[str, list[Any]]:
    reason = (
        "EXISTS (SELECT 1 FROM reasons WHERE reason = ? AND reasons.outcome = i.outcome "
        "AND reasons.sequence = i.sequence)"
    )
    given = (
        ("i.lot = ?", query.lot),
        ("l.grower = ?", query.grower),
        ("i.began_utc_ms >= ?", query.from_utc_ms),
        ("i.began_utc_ms < ?", query.to_utc_ms),
        ("i.outcome = ?", query.outcome),
        (reason, query.reason),
        ("r.name = ?", query.fruit),
    )
    chosen = [(text, value) for text, value in given if value is not None]
    return "".join(f" AND {text}" for text, _ in chosen), [value for _, value in chosen]


@contextmanager
def _csv_writer(path: Path) -> Iterator[Callable[[Rows], None]]:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([column.name for column in COLUMNS])
        kinds = [column.kind for column in COLUMNS]

        def write(rows: Rows) -> None:
            for row in rows:
                writer.writerow([_text(kind, value) for kind, value in zip(kinds, row, strict=True)])

        yield write


@contextmanager
def _parquet_writer(path: Path) -> Iterator[Callable[[Rows], None]]:
    with pq.ParquetWriter(path, SCHEMA, compression="zstd") as writer:

        def write(rows: Rows) -> None:
            columns = [
                pa.array([_value(column.kind, value) for value in values], column.kind)
                for column, values in zip(COLUMNS, zip(*rows, strict=True), strict=True)
            ]
            writer.write_table(pa.Table.from_arrays(columns, schema=SCHEMA))

        yield write


def _value(kind: pa.DataType, value: Any) -> Any:
    if value is None:
        return None
    if pa.types.is_list(kind):
        return json.loads(value)
    return bool(value) if pa.types.is_boolean(kind) else value


def _text(kind: pa.DataType, value: Any) -> Any:
    if value is None:
        return ""
    if pa.types.is_timestamp(kind):
        return datetime.fromtimestamp(value / 1000, UTC).isoformat(timespec="milliseconds")
    if pa.types.is_boolean(kind):
        return "true" if value else "false"
    return csv_cell(value) if isinstance(value, str) else value
