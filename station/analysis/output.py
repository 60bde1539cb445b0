"""Output folder of an analysis, written as results come, so that a finished measurement is never lost."""

import contextlib
import csv
import errno
import math
import os
from collections.abc import Iterable, Sequence
from io import FileIO, StringIO
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np
import numpy.typing as npt

from station.analysis.measurement import Measured, Refused
from station.analysis.press_curve import PressCurve
from station.errors import BadInputError
from station.inspection.monotone import WrongFrame
from station.vision.contact import Contact
from station.vision.quality import DenoisingQuality
from station.vocabulary import Flag

RESULT_COLUMNS = ("image", "contact", "area_px", "area_mm2", "centroid_x_px", "centroid_y_px", "flags")
CURVE_COLUMNS = ("image", "width_mm", "closing_mm", "area_px", "area_mm2", "expected_mm2", "press")
DETAIL_COLUMNS = ("image", "confidence", "gate", "drift_levels", "changed_area_px")
_OWN_NAMES = (
    "results.csv",
    "errors.csv",
    "curve.csv",
    "curve.svg",
    "denoising.csv",
    "details.csv",
    "masks",
    "stages",
    "stages.png",
    "contact_sheet.png",
    "report.html",
)
CONVERTED = "converted"
"""Flag of an image that was not stored as 8-bit colour."""


class OutputFolder:
    """Folder `DIR` of `station analyze`. It contains one analysis and refuses a second one."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._made: list[Path] = []
        self._results: FileIO | None = None
        self._waiting: dict[int, tuple[object, ...] | None] = {}
        """Rows that come before their turn; None for an image without a row."""
        self._next = 0

    def __enter__(self) -> Self:
        """Make the folder and check that it is writable.

        Raises:
            BadInputError: it contains an earlier result, is a file, or cannot be written.
        """
        try:
            earlier = [name for name in _OWN_NAMES if (self.folder / name).exists()]
            if earlier:
                raise BadInputError(
                    f"{self.folder}: holds an earlier result ({', '.join(earlier)}); name another folder or remove it"
                )
            self._made = [place for place in (self.folder, *self.folder.parents) if not place.exists()]
            (self.folder / "masks").mkdir(parents=True)
        except OSError as error:
            raise self._refusal(self.folder, error) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the table; remove the folder if nothing could be measured and it is empty."""
        with contextlib.suppress(BadInputError):  # ended early: the rows that are left follow without those before them
            for number in sorted(self._waiting):
                self._append(self._waiting.pop(number))
        if self._results is not None:
            self._results.close()
            return
        with contextlib.suppress(OSError):  # what cannot be tidied is not worth more than the error that led here
            for orphan in (self.folder / "masks").iterdir():
                orphan.unlink()
            (self.folder / "masks").rmdir()
            for place in self._made:
                place.rmdir()

    def add(self, measured: Measured, area_mm2: float) -> None:
        """Write an image's mask, then its row as soon as the rows of all images before it are written.

        Raises:
            BadInputError: the disk is full or the folder has become unwritable.
        """
        contact = measured.contact
        self.write_picture(f"masks/{measured.source.stem}.png", contact.mask)
        x_px, y_px = contact.centroid_px or (None, None)
        row = (
            measured.source.name,
            int(contact.found),
            contact.area_px,
            f"{area_mm2:.3f}",
            "" if x_px is None else f"{x_px:.2f}",
            "" if y_px is None else f"{y_px:.2f}",
            ";".join(flag_names(measured)),
        )
        self._in_turn(measured.number, row)

    def skip(self, refused: Refused) -> None:
        """Skip the row of an image that could not be measured.

        Raises:
            BadInputError: as in `add`, for the rows that waited for it.
        """
        self._in_turn(refused.number, None)

    def _in_turn(self, number: int, row: tuple[object, ...] | None) -> None:
        self._waiting[number] = row
        while self._next in self._waiting:
            self._append(self._waiting.pop(self._next))
            self._next += 1

    def _append(self, row: tuple[object, ...] | None) -> None:
        if row is None:
            return
        path = self.folder / "results.csv"
        try:
            if self._results is None:
                # Without a buffer, so that a row is in the file once it is written, also where the program is killed.
                self._results = path.open("xb", buffering=0)
                _append_whole(self._results, _csv_bytes([RESULT_COLUMNS, row]))
            else:
                _append_whole(self._results, _csv_bytes([row]))
        except OSError as error:
            raise self._refusal(path, error) from error

    def add_stages(self, measured: Measured) -> None:
        """Write each stage's picture of one image.

        Raises:
            BadInputError: the disk is full or the folder has become unwritable.
        """
        for number, (name, picture) in enumerate(measured.stages.items(), start=1):
            self.write_picture(f"stages/{measured.source.stem}_{number}_{name}.png", picture)

    def write_errors(self, refused: Iterable[Refused]) -> None:
        """Write the images that could not be measured, in the order given by the user, with the reasons."""
        rows = [(item.source.name, item.reason) for item in refused]
        if rows:
            self._write_table("errors.csv", ("image", "error"), rows)

    def write_curves(self, curves: Sequence[PressCurve]) -> None:
        """Write the presses' area curves; the row of an area that does not fit the others contains the expected one."""
        rows = []
        for press in curves:
            expected = {frame.index: _expectation(frame) for frame in press.wrong}
            rows += [
                (
                    row.image,
                    f"{point.reading.width_mm:g}",
                    f"{point.closing_mm:.3f}",
                    point.reading.area_px,
                    f"{point.reading.area_mm2:.3f}",
                    expected.get(place, ""),
                    press.number,
                )
                for place, (row, point) in enumerate(zip(press.rows, press.curve.points, strict=True))
            ]
        self._write_table("curve.csv", CURVE_COLUMNS, rows)

    def write_details(self, contacts: Sequence[tuple[str, Contact]]) -> None:
        """Write by the images' names the method's own values of its measurement; see `Contact` for the meaning."""
        rows = [
            (
                name,
                *("" if value is None else f"{value:.3f}" for value in (c.confidence, c.gate, c.drift_levels)),
                "" if c.changed_area_px is None else c.changed_area_px,
            )
            for name, c in contacts
        ]
        self._write_table("details.csv", DETAIL_COLUMNS, rows)

    def write_denoising(self, qualities: Sequence[tuple[str, DenoisingQuality]]) -> None:
        """Write by the images' names the figures of the denoising, as in the paper's Table 2."""
        rows = [(name, f"{q.psnr_db:.3f}", f"{q.mse:.3f}", f"{q.ssim:.4f}") for name, q in qualities]
        self._write_table("denoising.csv", ("image", "psnr_db", "mse", "ssim"), rows)

    def write_picture(self, name: str, picture: npt.NDArray[np.uint8]) -> None:
        """Write a picture, (height, width) or (height, width, 3), dtype uint8, as PNG at a path below the folder."""
        self.write_bytes(name, cv2.imencode(".png", picture)[1].tobytes())

    def write_bytes(self, name: str, data: bytes) -> None:
        """Write a file at a path below the folder.

        Raises:
            BadInputError: the disk is full or the folder has become unwritable.
        """
        path = self.folder / name
        try:
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(data)
        except OSError as error:
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
            raise self._refusal(path, error) from error

    def _write_table(self, name: str, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
        self.write_bytes(name, _csv_bytes([header, *rows]))

    def _refusal(self, path: Path, error: OSError) -> BadInputError:
        kept = f"; the results so far are kept in {self.folder}" if self._results is not None else ""
        remedy = "free space" if error.errno in {errno.ENOSPC, errno.EDQUOT, errno.EFBIG} else "name another --out"
        return BadInputError(f"{path}: cannot be written: {error.strerror}; {remedy}{kept}")


def _expectation(frame: WrongFrame) -> str:
    if math.isinf(frame.expected_high):
        return f"at least {frame.expected_low:.3f}"
    return f"{frame.expected_low:.3f} to {frame.expected_high:.3f}"


def _csv_bytes(rows: Iterable[Sequence[object]]) -> bytes:
    text = StringIO(newline="")
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()


def _append_whole(file: FileIO, data: bytes) -> None:
    """Append all or nothing, so that a full disk never leaves half a row."""
    end = file.tell()
    try:
        written = file.write(data)
    except OSError:
        file.truncate(end)
        raise
    if written != len(data):
        file.truncate(end)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def flag_names(measured: Measured) -> list[str]:
    """Return the flags of an area, in a fixed order."""
    names = [flag.value for flag in Flag if flag in measured.contact.flags]
    return [*names, CONVERTED] if measured.conversions else names
