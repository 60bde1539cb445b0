"""Width table: the gripper widths of a folder of images."""

import csv
import math
from io import StringIO
from pathlib import Path

from station.errors import BadInputError

_HEADER = ("image", "width_mm")
_WIDEST_MM = 200.0
_LARGEST_FILE_BYTES = 10_000_000


def read_widths(path: Path) -> dict[str, float]:
    """Read a CSV with the columns `image,width_mm`; further columns are ignored.

    Returns:
        The measured width in mm by the image's name.

    Raises:
        BadInputError: the file cannot be read, lacks a column, names an image twice, or has a width that is no
            number from 0 to 200 mm.
    """
    reader = csv.DictReader(StringIO(_text(path), newline=""))
    try:
        header = reader.fieldnames or ()
    except csv.Error as error:
        raise BadInputError(f"{path}:1: not a CSV table: {error}") from error
    if not set(_HEADER) <= set(header):
        raise BadInputError(f"{path}:1: expected the header {','.join(_HEADER)}")
    widths: dict[str, float] = {}
    try:
        for row in reader:
            place = f"{path}:{reader.line_num}"
            name = (row["image"] or "").strip()
            if not name:
                raise BadInputError(f"{place}: image: expected a file name")
            if name in widths:
                raise BadInputError(f"{place}: image: {name} is listed twice")
            widths[name] = _width_mm(place, row["width_mm"])
    except csv.Error as error:
        raise BadInputError(f"{path}:{reader.line_num}: not a CSV table: {error}") from error
    if not widths:
        raise BadInputError(f"{path}: expected a row for each image, found none")
    return widths


def _text(path: Path) -> str:
    try:
        if not path.is_file():
            raise BadInputError(f"{path}: expected a CSV file; there is none, or it is something else")
        with path.open("rb") as file:
            data = file.read(_LARGEST_FILE_BYTES + 1)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read: {error.strerror}") from error
    if len(data) > _LARGEST_FILE_BYTES:
        raise BadInputError(f"{path}: expected a table of widths of at most {_LARGEST_FILE_BYTES} bytes")
    try:
        # Spreadsheets may begin a file with a byte order mark.
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise BadInputError(f"{path}: expected UTF-8; save the table as CSV UTF-8") from error


def _width_mm(place: str, text: str | None) -> float:
    try:
        width_mm = float(text or "")
    except ValueError:
        width_mm = math.nan
    if not 0 <= width_mm <= _WIDEST_MM:
        raise BadInputError(f"{place}: width_mm: expected a number from 0 to {_WIDEST_MM:g} mm, found {text!r}")
    return width_mm
