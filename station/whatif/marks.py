"""Mark table: CSV file of fruit that a person found good or bad."""

import csv
from io import StringIO
from pathlib import Path

from station.errors import BadInputError
from station.messages import whatif as messages
from station.records.marks import Mark

_LARGEST_FILE_BYTES = 50_000_000


def read_marks(path: Path) -> dict[int, Mark]:
    """Read a table with the columns `sequence` and `mark`, `good` or `bad`; further columns are ignored.

    Raises:
        BadInputError: it cannot be read, lacks a column, marks a fruit twice, or has an invalid word or number.
    """
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_FILE_BYTES + 1)
        # Spreadsheets may begin a file with a byte order mark.
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise BadInputError(
            messages.UNREADABLE(path=str(path), words=(error.strerror or str(error)).lower())
        ) from error
    except UnicodeDecodeError as error:
        raise BadInputError(messages.NOT_UTF8(path=str(path))) from error
    if len(data) > _LARGEST_FILE_BYTES:
        raise BadInputError(messages.TOO_LARGE(path=str(path), most=_LARGEST_FILE_BYTES))
    reader = csv.DictReader(StringIO(text, newline=""))
    marks: dict[int, Mark] = {}
    try:
        if not {"sequence", "mark"} <= set(reader.fieldnames or ()):
            raise BadInputError(messages.NO_HEADER(path=str(path)))
        for row in reader:
            sequence, mark = _row(f"{path}:{reader.line_num}", row)
            if marks.setdefault(sequence, mark) != mark:
                raise BadInputError(messages.MARKED_TWICE(place=f"{path}:{reader.line_num}", number=sequence))
    except csv.Error as error:
        raise BadInputError(messages.NO_TABLE(place=f"{path}:{reader.line_num}", words=str(error))) from error
    return marks


def _row(place: str, row: dict[str, str]) -> tuple[int, Mark]:
    number, word = (row["sequence"] or "").strip(), (row["mark"] or "").strip().lower()
    if not (number.isascii() and number.isdigit() and len(number) <= 10):
        raise BadInputError(messages.BAD_NUMBER(place=place, text=f"{number!r:.50}"))
    marks: dict[str, Mark] = {"good": "good", "bad": "bad"}
    if word not in marks:
        raise BadInputError(messages.BAD_MARK(place=place, text=f"{word!r:.50}"))
    return int(number), marks[word]
