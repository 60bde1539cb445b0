"""Pending rejects on the disk: they survive a restart of the interface."""

import json
import logging
from collections.abc import Mapping
from pathlib import Path

from plc_interface.outputs.can.counts import RANGE
from station.atomic_file import write_atomically

log = logging.getLogger(__name__)


class PendingRejectFile:
    """One file, replaced as a whole. It belongs to the holder of the journal's lock."""

    def __init__(self, folder: Path) -> None:
        """Prepare the file in the journal's folder; nothing is read or written yet."""
        self._path = folder / "shots.json"

    def read(self) -> dict[int, int]:
        """Return the counts at which flaps are to open, by sequence; none if the file is absent or damaged."""
        try:
            counts = {int(sequence): int(count) for sequence, count in json.loads(self._path.read_bytes()).items()}
        except FileNotFoundError:
            return {}
        except (OSError, ValueError, TypeError, AttributeError) as error:
            log.error(  # noqa: TRY400 (the file is at fault, not the code)
                "the pending rejects in %s cannot be read (%s): look at the fruit between the nest and the gate",
                self._path,
                type(error).__name__,
            )
            return {}
        return {sequence: count for sequence, count in counts.items() if 1 <= sequence < RANGE and 0 <= count < RANGE}

    def write(self, counts: Mapping[int, int]) -> None:
        """Replace the file by counts as `read` returns them. A failure is logged: the line goes on.

        It only has to outlive the process, and does not wait for the disk, which may take longer than the PLC or the
        station waits for this process: after a loss of power the fruit have passed the gate.
        """
        try:
            write_atomically(self._path, json.dumps(counts).encode(), durable=False)
        except OSError as error:
            log.error("the pending rejects cannot be written to %s: %s", self._path, error.strerror)  # noqa: TRY400
