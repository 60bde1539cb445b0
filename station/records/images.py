"""Image store: PNG files named by their content, written by a thread of their own."""

import contextlib
import hashlib
import logging
import math
import os
import queue
import shutil
import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any, NamedTuple

import cv2

from station.atomic_file import PARTIAL, write_atomically
from station.errors import StationError
from station.messages import records as messages
from station.records.error_mapping import map_error
from station.records.errors import RecordsError
from station.records.model import Image
from station.records.retention import forget_missing, referred, remove_oldest_images
from station.records.write_requests import add_images
from station.records.writer import Work
from station.settings.records import RecordsSettings

log = logging.getLogger(__name__)

FOLDER_NAME = "images"
MB = 1_000_000
_PNG = [cv2.IMWRITE_PNG_COMPRESSION, 1]
_RECORDED_S = 30.0
"""Longest wait for the writer; after it the images are dropped."""


class _Set(NamedTuple):
    """One inspection's images."""

    sequence: int
    accepted: bool
    images: tuple[Image, ...]


class _NotStoredError(StationError):
    """An inspection's images are not stored, for the reason in its message."""

    result = "dropped"


class _OverQuotaError(_NotStoredError):
    """An accepted fruit's images are not stored: the quota is full of those of rejected fruit, as it is meant to be."""

    result = "over_quota"


def image_path(folder: Path, sha256: str) -> str:
    """Return the path of the image whose bytes have this SHA-256 (not a `Path`: see `station.atomic_file`)."""
    return os.path.join(folder, FOLDER_NAME, sha256[:2], f"{sha256}.png")


def accepted_is_stored(sequence: int, share: float) -> bool:
    """Check whether an accepted fruit's images are stored: a share, 0 to 1, evenly spread, and always the same ones."""
    return math.floor(sequence * share) > math.floor((sequence - 1) * share)


class ImageStore:
    """Background writer of images; images that cannot be written are dropped and reported."""

    def __init__(self, folder: Path, settings: RecordsSettings, submit: Callable[[Work[Any]], Future[Any]]) -> None:
        """Start the thread, which submits to the writer; it first reconciles files and rows, and makes space."""
        self.results: Counter[str] = Counter()
        self.size_bytes = 0
        self._folder = folder
        self._settings = settings
        self._submit = submit
        self._places = threading.BoundedSemaphore(settings.images_queue)
        self._put = self._done = 0
        self._counted = False
        self._queue: queue.SimpleQueue[_Set | None] = queue.SimpleQueue()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="records-images", daemon=True)
        self._thread.start()

    @property
    def waiting(self) -> int:
        """Count inspections whose images wait for the disk or are being written."""
        return self._put - self._done

    def reserve(self) -> bool:
        """Reserve a place in the queue, if there is one; then call either `put` or `release`."""
        return self._places.acquire(blocking=False)

    def release(self) -> None:
        """Return a reserved place."""
        self._places.release()

    def put(self, sequence: int, candidates: tuple[Image, ...], *, accepted: bool) -> None:
        """Queue one inspection's images, in the place reserved."""
        self._put += 1
        self._queue.put(_Set(sequence, accepted, candidates))

    def drop(self, number: int) -> None:
        """Count images that found no place."""
        self.results["dropped"] += number

    def close(self, within_s: float) -> None:
        """Write the queue, for `within_s` at most, and end the thread. Idempotent; blocks."""
        self._queue.put(None)
        self._thread.join(within_s)
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        with contextlib.suppress(OSError, StationError):  # tried again before images are written
            self._reconcile()
            # Not only before images are written: below the reserve no inspection begins that could bring some.
            if self.size_bytes:
                self._make_space(0, accepted=False)
        while (work := self._queue.get()) is not None and not self._stopping.is_set():
            self._store(work)
            self._done += 1
            self.release()

    def _store(self, work: _Set) -> None:
        """Write the files first, durably; then the rows that refer to them."""
        rows: list[dict[str, Any]] = []
        try:
            if not self._counted:
                self._reconcile()
            encoded = [_encoded(image) for image in work.images]
            self._make_space(sum(len(content) for content in encoded), accepted=work.accepted)
            for image, content in zip(work.images, encoded, strict=True):
                sha256 = hashlib.sha256(content).hexdigest()
                self._write(image_path(self._folder, sha256), content)
                rows.append({"kind": image.kind, "step": image.step, "sha256": sha256, "size_bytes": len(content)})
            state, left = messages.IMAGES_KEPT(), 0
        except _NotStoredError as error:
            state, left = messages.IMAGES_DROPPED(cause=error.message), len(work.images) - len(rows)
            self.results[error.result] += left
        except Exception as error:  # noqa: BLE001 (an image must not cost the thread)
            left = len(work.images) - len(rows)
            cause = map_error(error, str(self._folder / FOLDER_NAME)).cause
            state = messages.IMAGES_DROPPED(cause=cause)
            self.results["failed"] += left
        if left and rows:
            state = messages.IMAGES_PARTLY(state=state, kept=len(rows), number=len(work.images))
        try:
            self._record(lambda connection: add_images(connection, work.sequence, rows, state))
        except (RecordsError, TimeoutError):
            self.results["failed"] += len(rows)
            return
        self.results.update({"kept": len(rows)} if rows else {})

    def _write(self, path: str, content: bytes) -> None:
        """Write one durable file; nothing is done if it exists already."""
        if self._stopping.is_set():
            raise _NotStoredError(messages.STATION_ENDED())
        if os.path.exists(path):
            return
        os.makedirs(os.path.dirname(path), exist_ok=True)
        write_atomically(path, content)
        self.size_bytes += len(content)

    def _make_space(self, needed_bytes: int, *, accepted: bool) -> None:
        """Remove older images until the new ones fit into the quota; what goes first is in `retention`.

        They are removed as well if the disk is nearly full: images must not take the space that inspections need.
        """
        quota_bytes = self._settings.images_quota_mb * MB
        if needed_bytes > quota_bytes:
            raise _NotStoredError(messages.OVER_QUOTA(needed_bytes=needed_bytes, quota_bytes=quota_bytes))
        reserve_bytes = 2 * self._settings.free_reserve_mb * MB
        while not self._stopping.is_set() and (
            (over := self.size_bytes + needed_bytes > quota_bytes) or self._free_bytes() < reserve_bytes
        ):
            removed = self._record(lambda connection: remove_oldest_images(connection, for_accepted=accepted))
            if removed is None:
                if over and accepted:
                    raise _OverQuotaError(messages.QUOTA_FULL())
                raise _NotStoredError(messages.QUOTA_FULL() if over else messages.DISK_NEARLY_FULL())
            freed_bytes, names = removed
            # After the commit that removed their rows: no row refers to a file that is gone.
            for name in names:
                with contextlib.suppress(FileNotFoundError):
                    os.unlink(image_path(self._folder, name))
            self.size_bytes -= freed_bytes
            self.results["removed"] += len(names)

    def _free_bytes(self) -> int:
        return shutil.disk_usage(self._folder).free

    def _reconcile(self) -> None:
        """Remove files that no row refers to, as after a killed station, report missing ones, count the rest."""
        wanted = self._record(referred)
        found = set()
        for file in (self._folder / FOLDER_NAME).glob("*/*"):
            if file.suffix == ".png" and file.stem in wanted:
                found.add(file.stem)
            elif file.suffix in {PARTIAL, ".png"}:
                file.unlink(missing_ok=True)
        missing = frozenset(wanted.keys() - found)
        if missing:
            log.warning("%d of %d images that the records refer to are missing", len(missing), len(wanted))
        if missing and found:  # none at all is a disk that is not mounted: they may come back
            self._record(lambda connection: forget_missing(connection, missing))
        self.size_bytes = sum(size for name, size in wanted.items() if name in found)
        self._counted = True

    def _record(self, work: Work[Any]) -> Any:
        return self._submit(work).result(_RECORDED_S)


def _encoded(image: Image) -> bytes:
    """Encode the image as PNG, without loss."""
    done, content = cv2.imencode(".png", image.pixels, _PNG)
    if not done:
        raise ValueError(f"no PNG can hold {image.pixels.dtype} of shape {image.pixels.shape}")
    return content.tobytes()
