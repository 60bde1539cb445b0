"""Mark table: CSV file of fruit that a person found good or bad."""

import csv
from io import StringIO
from pathlib import Path

from station.errors import BadInputError
from station.records.marks import Mark

_LARGEST_FILE_BYTES = 50_000_000


def read_marks(path: Path) -> dict[int, Mark]:
    """Read a table with the columns `sequence` and `mark`, the latter `good` or `bad`.

    Args:
        path: the file; further columns are ignored.

    Raises:
        BadInputError: it cannot be read, lacks a column, marks a fruit twice, or has an invalid word or number.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_FILE_BYTES + 1)
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from error
    except UnicodeDecodeError as error:
        raise BadInputError(f"{path}: expected UTF-8; save the table as CSV UTF-8") from error
    if len(data) > _LARGEST_FILE_BYTES:
        raise BadInputError(f"{path}: expected at most {_LARGEST_FILE_BYTES} bytes")
    reader = csv.DictReader(StringIO(text, newline=""))
    marks: dict[int, Mark] = {}
    try:
        if not {"sequence", "mark"} <= set(reader.fieldnames or ()):
            raise BadInputError(f"{path}:1: expected the header sequence,mark")
        for row in reader:
            sequence, mark = _row(f"{path}:{reader.line_num}", row)
            if marks.setdefault(sequence, mark) != mark:
                raise BadInputError(f"{path}:{reader.line_num}: {sequence} is marked good and bad")
    except csv.Error as error:
        raise BadInputError(f"{path}:{reader.line_num}: not a CSV table: {error}") from error
    return marks


def _row(place: str, row: dict[str, str]) -> tuple[int, Mark]:
    number, word = (row["sequence"] or "").strip(), (row["mark"] or "").strip().lower()
    if not (number.isascii() and number.isdigit() and len(number) <= 10):
        raise BadInputError(f"{place}: sequence: expected an inspection's number, got {number!r:.50}")
    marks: dict[str, Mark] = {"good": "good", "bad": "bad"}
    if word not in marks:
        raise BadInputError(f"{place}: mark: expected good or bad, got {word!r:.50}")
    return int(number), marks[word]
