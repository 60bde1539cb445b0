"""Calibration store: each calibration and verification is a folder, written atomically and never changed.

`calibrations/SERIAL/ID/`, `verifications/SERIAL/ID/` and, to show a person the reasons,
`refused_calibrations/SERIAL/ID/` in the home folder, with the record, its pictures and a page. A change of the gel puts
a mark `ID.gel_changed` beside each of the unit's calibrations, which takes it out of force for good.
"""

import contextlib
import fcntl
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from pydantic import TypeAdapter, ValidationError

from station.atomic_file import sync_folder, write_atomically
from station.calibration.errors import CalibrationError, UnknownCalibrationError
from station.calibration.model import Calibration, GelChange, Refusal, Serial, Stamp, Stored, Verification
from station.messages import calibration as messages
from station.vision.contact import Image

CALIBRATIONS, VERIFICATIONS, REFUSALS = "calibrations", "verifications", "refused_calibrations"
RECORDS = {CALIBRATIONS: "calibration.json", VERIFICATIONS: "verification.json", REFUSALS: "refusal.json"}
REFERENCE = "reference.png"
PAGE = "report.html"
GEL_CHANGED = ".gel_changed"
"""Suffix of the mark beside the folder of a calibration of an earlier gel. Its presence alone counts."""
_UNFINISHED = ".unfinished-"
_NAME = TypeAdapter(Stamp)
_SERIAL = TypeAdapter(Serial)
RecordT = TypeVar("RecordT", bound=Stored)


class CalibrationStore:
    """Calibrations and verifications of one station."""

    def __init__(self, home: Path) -> None:
        self._home = home

    def add_calibration(self, calibration: Calibration, files: Mapping[str, bytes]) -> Path:
        """Store a calibration, with pictures and page by name, and return its folder; from now on it is the unit's.

        Raises:
            CalibrationError: it could not be written; nothing is left of it.
        """
        return self.prepare_calibration(calibration, files).put_in_force()

    def prepare_calibration(self, calibration: Calibration, files: Mapping[str, bytes]) -> "Prepared":
        """Write a calibration with all its files, which takes the disk its time; it is not in force yet.

        Raises:
            CalibrationError: it could not be written; nothing is left of it.
        """
        return self._prepare(CALIBRATIONS, calibration.serial, calibration.id, calibration, files)

    def add_verification(self, verification: Verification, files: Mapping[str, bytes]) -> Path:
        """Store a verification, as `add_calibration`."""
        return self.prepare_verification(verification, files).put_in_force()

    def prepare_verification(self, verification: Verification, files: Mapping[str, bytes]) -> "Prepared":
        """Write a verification, as `prepare_calibration`."""
        return self._prepare(VERIFICATIONS, verification.serial, verification.id, verification, files)

    def add_refusal(self, refusal: Refusal, files: Mapping[str, bytes]) -> Path:
        """Store a refused calibration for a person to inspect, as `add_calibration`. It is never used."""
        return self._prepare(REFUSALS, refusal.serial, refusal.id, refusal, files).put_in_force()

    def serials(self) -> tuple[str, ...]:
        """Return the units that were ever calibrated."""
        return tuple(sorted(path.name for path in _folders(self._home / CALIBRATIONS)))

    def calibrations(self, serial: str) -> tuple[Calibration, ...]:
        """Return a unit's readable calibrations, also those of an earlier gel, the newest first."""
        return tuple(self._all(CALIBRATIONS, serial, Calibration))

    def current(self, serial: str) -> Calibration | None:
        """Return the newest readable calibration of the unit's present gel; None if there is none."""
        return next(self._all(CALIBRATIONS, serial, Calibration, of_present_gel=True), None)

    def mark_gel_changed(self, serial: str, change: GelChange) -> None:
        """Take all of a unit's calibrations out of force: they are those of an earlier gel.

        Each is marked, not the newest alone, so that none returns where a person moves a newer one away.

        Raises:
            CalibrationError: it could not be stored; the calibration in force may still be.
        """
        folder, data = self._home / CALIBRATIONS / _SERIAL.validate_python(serial), change.model_dump_json().encode()
        try:
            # The newest last: an older one never takes its place meanwhile.
            for path in sorted(made := _folders(folder)):
                write_atomically(_gel_mark(path), data)
            if made:
                # Files made within one tick of the kernel's clock leave the folder the same time, and who watches it
                # may have read it between two of them: a time of another clock is seen as a change for certain.
                now_ns = time.time_ns()
                with contextlib.suppress(PermissionError):  # another user's folder: the marks have changed its time
                    os.utime(folder, ns=(now_ns, now_ns))
        except OSError as error:
            raise _not_stored(folder, error) from error

    def gel_change(self, serial: str) -> GelChange | None:
        """Return the last change of a unit's gel; None if none is known."""
        with contextlib.suppress(OSError, ValueError):
            folder = self._home / CALIBRATIONS / _SERIAL.validate_python(serial)
            return GelChange.model_validate_json(max(folder.glob(f"*{GEL_CHANGED}")).read_bytes())
        return None

    def is_of_earlier_gel(self, calibration: Calibration) -> bool:
        """Return whether the gel was changed since the calibration."""
        return _gel_mark(self.folder(calibration)).exists()

    def verifications(self, serial: str) -> tuple[Verification, ...]:
        """Return a unit's readable verifications, the newest first."""
        return tuple(self._all(VERIFICATIONS, serial, Verification))

    def last_verification(self, calibration: Calibration) -> Verification | None:
        """Return the newest verification against a calibration; None if there is none."""
        of_unit = self._all(VERIFICATIONS, calibration.serial, Verification)
        return next((one for one in of_unit if one.calibration == calibration.id), None)

    def golden(self, calibration: Calibration) -> Image:
        """Read a calibration's picture of the untouched gel.

        Raises:
            CalibrationError: it is missing or no picture.
        """
        return _picture(self.folder(calibration) / REFERENCE)

    def presses(self, calibration: Calibration) -> list[Image]:
        """Read a calibration's pictures of the ball, in the order of its curve.

        Raises:
            CalibrationError: one is missing or no picture.
        """
        return [_picture(self.folder(calibration) / press_name(number)) for number in range(len(calibration.curve))]

    def folder(self, record: Calibration | Verification) -> Path:
        """Return the folder of a record and its page."""
        kind = CALIBRATIONS if isinstance(record, Calibration) else VERIFICATIONS
        return self._home / kind / record.serial / record.id

    def find(self, name: str, serial: str | None = None) -> Calibration:
        """Find a calibration by its name, as `list` shows it, among a unit's, or all where `serial` is None.

        Raises:
            UnknownCalibrationError: there is none, or it cannot be read.
        """
        for one in [serial] if serial else self.serials():
            for calibration in self.calibrations(one):
                if calibration.id == name:
                    return calibration
        raise UnknownCalibrationError(messages.UNKNOWN(name=repr(name)))

    def _prepare(self, kind: str, serial: str, name: str, record: Stored, files: Mapping[str, bytes]) -> "Prepared":
        # Validated as it names a folder: another text might lead out of the home folder.
        folder = self._home / kind / _SERIAL.validate_python(serial)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with _locked(folder):  # a new folder is not locked at once
                _remove_unfinished(folder)
                unfinished = Path(tempfile.mkdtemp(dir=folder, prefix=_UNFINISHED))
                prepared = Prepared(unfinished, folder / name)
            try:
                # A folder of `mkdtemp` is readable for its user only.
                unfinished.chmod(0o755)
                for file, data in {**files, RECORDS[kind]: record.model_dump_json(indent=1).encode()}.items():
                    _write(unfinished / file, data)
                sync_folder(unfinished)
            except BaseException:
                prepared.discard()
                raise
        except OSError as error:
            raise _not_stored(folder / name, error) from error
        return prepared

    def _all(self, kind: str, serial: str, model: type[RecordT], *, of_present_gel: bool = False) -> Iterator[RecordT]:
        with contextlib.suppress(ValidationError):
            folder = self._home / kind / _SERIAL.validate_python(serial)
            # The names are times, so their order is that of time.
            for path in sorted(_folders(folder), reverse=True):
                if of_present_gel and _gel_mark(path).exists():
                    continue
                with contextlib.suppress(OSError, ValidationError):
                    _NAME.validate_python(path.name)
                    yield model.model_validate_json((path / RECORDS[kind]).read_bytes())


class Prepared:
    """A record that is complete and durable, and not in force yet. Its folder is locked until then."""

    def __init__(self, unfinished: Path, folder: Path) -> None:
        self._unfinished, self._folder = unfinished, folder
        self._in_force = False
        self._lock = contextlib.ExitStack()
        self._lock.enter_context(_locked(unfinished))

    def put_in_force(self) -> Path:
        """Put the record in force by its folder's name alone, and return the folder.

        Raises:
            CalibrationError: it could not be; nothing is left of it.
        """
        try:
            self._unfinished.rename(self._folder)
            # Before the sync: where that fails, `discard` takes the record back.
            self._in_force = True
            sync_folder(self._folder.parent)
        except OSError as error:
            self.discard()
            raise _not_stored(self._folder, error) from error
        self._lock.close()
        return self._folder

    def discard(self) -> None:
        """Remove the record, also one that is in force. Idempotent."""
        if self._in_force:
            with contextlib.suppress(OSError):
                self._folder.rename(self._unfinished)  # whole at once: a reader never finds a part of it
            self._in_force = False
        shutil.rmtree(self._unfinished, ignore_errors=True)
        self._lock.close()


@contextlib.contextmanager
def _locked(folder: Path, flags: int = fcntl.LOCK_EX) -> Iterator[None]:
    """Lock a folder; the kernel unlocks it where the process is killed."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, flags)
        yield
    finally:
        os.close(descriptor)


def _remove_unfinished(folder: Path) -> None:
    """Remove what killed processes left; another process holds the lock of one that it prepares."""
    for left in folder.glob(f"{_UNFINISHED}*"):
        with contextlib.suppress(OSError), _locked(left, fcntl.LOCK_EX | fcntl.LOCK_NB):
            shutil.rmtree(left, ignore_errors=True)


def _not_stored(folder: Path, error: OSError) -> CalibrationError:
    return CalibrationError(messages.NOT_STORED(folder=str(folder), error=str(error.strerror)))


def press_name(number: int) -> str:
    """Return the file name of a step's picture, counted from 0."""
    return f"press_{number:02d}.png"


def _gel_mark(folder: Path) -> Path:
    return folder.with_name(f"{folder.name}{GEL_CHANGED}")


def _picture(path: Path) -> Image:
    picture = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if picture is None:
        raise CalibrationError(messages.PICTURE_UNREADABLE(file=str(path)))
    return np.asarray(picture, np.uint8)


def _folders(folder: Path) -> list[Path]:
    try:
        # A name that begins with a dot is that of an unfinished record.
        return [path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")]
    except OSError:
        return []


def _write(path: Path, data: bytes) -> None:
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
