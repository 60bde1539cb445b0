"""Calibrations and verifications on the disk: each a folder of its own, there whole or not at all, and never changed.

`calibrations/SERIAL/ID/`, `verifications/SERIAL/ID/` and, for a person to see why, `refused_calibrations/SERIAL/ID/` in
the home folder, with the record, its pictures and a page.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from pydantic import TypeAdapter, ValidationError

from station.calibration.errors import CalibrationError, UnknownCalibrationError
from station.calibration.model import Calibration, Refusal, Serial, Stamp, Stored, Verification
from station.vision.contact import Image

CALIBRATIONS, VERIFICATIONS, REFUSALS = "calibrations", "verifications", "refused_calibrations"
RECORDS = {CALIBRATIONS: "calibration.json", VERIFICATIONS: "verification.json", REFUSALS: "refusal.json"}
REFERENCE = "reference.png"
PAGE = "report.html"
_UNFINISHED = ".unfinished-"
_NAME = TypeAdapter(Stamp)
_SERIAL = TypeAdapter(Serial)
RecordT = TypeVar("RecordT", bound=Stored)


class CalibrationStore:
    """What was calibrated and verified on one station.

    Args:
        home: the station's home folder.
    """

    def __init__(self, home: Path) -> None:
        self._home = home

    def add_calibration(self, calibration: Calibration, files: Mapping[str, bytes]) -> Path:
        """Keep a calibration; from now on it is the unit's.

        Args:
            calibration: good.
            files: its pictures and page, by their names.

        Returns:
            Its folder.

        Raises:
            CalibrationError: it could not be written, and nothing is left of it.
        """
        return self._add(CALIBRATIONS, calibration.serial, calibration.id, calibration, files)

    def add_verification(self, verification: Verification, files: Mapping[str, bytes]) -> Path:
        """Keep a verification, as `add_calibration`.

        Args:
            verification: passed or not.
            files: its pictures and page.
        """
        return self._add(VERIFICATIONS, verification.serial, verification.id, verification, files)

    def add_refusal(self, refusal: Refusal, files: Mapping[str, bytes]) -> Path:
        """Keep what was no calibration, for a person to look at, as `add_calibration`. It is never used.

        Args:
            refusal: why.
            files: its pictures and page.
        """
        return self._add(REFUSALS, refusal.serial, refusal.id, refusal, files)

    def serials(self) -> tuple[str, ...]:
        """The units that were ever calibrated."""
        return tuple(sorted(path.name for path in _folders(self._home / CALIBRATIONS)))

    def calibrations(self, serial: str) -> tuple[Calibration, ...]:
        """A unit's calibrations that can be read, the newest first.

        Args:
            serial: the unit's.
        """
        return tuple(self._all(CALIBRATIONS, serial, Calibration))

    def current(self, serial: str) -> Calibration | None:
        """The unit's newest calibration that can be read; None where there is none.

        Args:
            serial: the unit's.
        """
        return next(self._all(CALIBRATIONS, serial, Calibration), None)

    def verifications(self, serial: str) -> tuple[Verification, ...]:
        """A unit's verifications that can be read, the newest first.

        Args:
            serial: the unit's.
        """
        return tuple(self._all(VERIFICATIONS, serial, Verification))

    def last_verification(self, calibration: Calibration) -> Verification | None:
        """The newest verification against a calibration; None where there is none.

        Args:
            calibration: the unit's.
        """
        of_unit = self._all(VERIFICATIONS, calibration.serial, Verification)
        return next((one for one in of_unit if one.calibration == calibration.id), None)

    def golden(self, calibration: Calibration) -> Image:
        """A calibration's picture of the untouched gel.

        Args:
            calibration: one of these.

        Raises:
            CalibrationError: it is gone or no picture.
        """
        return _picture(self.folder(calibration) / REFERENCE)

    def presses(self, calibration: Calibration) -> list[Image]:
        """A calibration's pictures of the ball, in the order of its curve.

        Args:
            calibration: one of these.

        Raises:
            CalibrationError: one is gone or no picture.
        """
        return [_picture(self.folder(calibration) / press_name(number)) for number in range(len(calibration.curve))]

    def folder(self, record: Calibration | Verification) -> Path:
        """Where a record and its page lie.

        Args:
            record: one of these.
        """
        kind = CALIBRATIONS if isinstance(record, Calibration) else VERIFICATIONS
        return self._home / kind / record.serial / record.id

    def find(self, name: str, serial: str | None = None) -> Calibration:
        """A calibration by its name.

        Args:
            name: as `list` shows it.
            serial: of its unit; any where None.

        Raises:
            UnknownCalibrationError: there is none, or it cannot be read.
        """
        for one in [serial] if serial else self.serials():
            for calibration in self.calibrations(one):
                if calibration.id == name:
                    return calibration
        raise UnknownCalibrationError(f"there is no calibration {name!r}; see `station calibrate list`")

    def _add(self, kind: str, serial: str, name: str, record: Stored, files: Mapping[str, bytes]) -> Path:
        folder = self._home / kind / _SERIAL.validate_python(serial)
        unfinished: Path | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for left in folder.glob(f"{_UNFINISHED}*"):
                shutil.rmtree(left, ignore_errors=True)
            unfinished = Path(tempfile.mkdtemp(dir=folder, prefix=_UNFINISHED))
            unfinished.chmod(0o755)
            for file, data in {**files, RECORDS[kind]: record.model_dump_json(indent=1).encode()}.items():
                _write(unfinished / file, data)
            _sync(unfinished)
            unfinished.rename(folder / name)
            _sync(folder)
        except OSError as error:
            if unfinished is not None:
                shutil.rmtree(unfinished, ignore_errors=True)
            raise CalibrationError(
                f"{folder / name}: cannot be stored: {error.strerror}; free space there, or make it writable, and "
                "do it again: nothing was kept"
            ) from error
        return folder / name

    def _all(self, kind: str, serial: str, model: type[RecordT]):  # noqa: ANN202 (an iterator of the model)
        with contextlib.suppress(ValidationError):
            folder = self._home / kind / _SERIAL.validate_python(serial)
            for path in sorted(_folders(folder), reverse=True):
                with contextlib.suppress(OSError, ValidationError):
                    _NAME.validate_python(path.name)
                    yield model.model_validate_json((path / RECORDS[kind]).read_bytes())


def press_name(number: int) -> str:
    """The file of a step's picture.

    Args:
        number: of the step, from 0.
    """
    return f"press_{number:02d}.png"


def _picture(path: Path) -> Image:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise CalibrationError(f"{path}: the calibration's picture cannot be read; calibrate again")
    return np.asarray(picture, np.uint8)


def _folders(folder: Path) -> list[Path]:
    try:
        return [path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")]
    except OSError:
        return []


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
