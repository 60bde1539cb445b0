"""Restart counts of the supervised processes, published to these in a small file."""

import json
import logging
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from station.atomic_file import write_atomically

RESTARTS_VARIABLE = "SUPERVISOR_RESTARTS"

log = logging.getLogger(__name__)


class Restarts(NamedTuple):
    """Restarts of one program."""

    total: int
    """Since the supervisor's start."""
    times_s: tuple[float, ...]
    """When, the last ones; monotonic, which all processes of a machine share."""
    given_up: bool

    def within(self, seconds: float) -> int:
        """Return the number of recent restarts."""
        return sum(time.monotonic() - at_s < seconds for at_s in self.times_s)


def publish(file: Path, programs: Mapping[str, Restarts]) -> None:
    """Write all programs by name to a file of the supervisor's, atomically; a write error is logged."""
    try:
        write_atomically(file, json.dumps(programs).encode(), durable=False)  # the counts end with the supervisor
    except OSError as error:
        log.warning("%s cannot be written: %s", file, error.strerror)


def read() -> dict[str, Restarts]:
    """Read the supervisor's counts; empty without a supervisor of ours."""
    name = os.environ.get(RESTARTS_VARIABLE, "")
    if not name:
        return {}
    try:
        with open(name, encoding="utf-8") as file:  # noqa: PTH123 (once a second: see `station.atomic_file`)
            data = json.load(file)
        return {
            program: Restarts(total, tuple(times_s), given_up) for program, (total, times_s, given_up) in data.items()
        }
    except (OSError, ValueError, TypeError, AttributeError) as error:
        log.warning("%s: expected the supervisor's count of restarts: %s", name, error)
        return {}
