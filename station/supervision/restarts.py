"""What the supervisor had to start again, told to the processes by a small file that each of them knows the name of."""

import json
import logging
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

RESTARTS_VARIABLE = "SUPERVISOR_RESTARTS"

log = logging.getLogger(__name__)


class Restarts(NamedTuple):
    """One program's."""

    total: int
    """Since the supervisor's start."""
    times_s: tuple[float, ...]
    """When, the last ones; monotonic, which all processes of a machine share."""
    given_up: bool

    def within(self, seconds: float) -> int:
        """How many there were lately.

        Args:
            seconds: how lately.
        """
        return sum(time.monotonic() - at_s < seconds for at_s in self.times_s)


def tell(file: Path, programs: Mapping[str, Restarts]) -> None:
    """Write it whole or not at all; a disk that takes nothing is logged.

    Args:
        file: in a folder of the supervisor's.
        programs: all of them by name.
    """
    unfinished = file.with_suffix(".new")
    try:
        unfinished.write_text(json.dumps(programs), encoding="utf-8")
        unfinished.replace(file)
    except OSError as error:
        log.warning("%s cannot be written: %s", file, error.strerror)


def told() -> dict[str, Restarts]:
    """What the supervisor of this process says; empty where there is none, or none of ours."""
    name = os.environ.get(RESTARTS_VARIABLE, "")
    try:
        data = json.loads(Path(name).read_text(encoding="utf-8")) if name else {}
        return {
            program: Restarts(total, tuple(times_s), given_up) for program, (total, times_s, given_up) in data.items()
        }
    except (OSError, ValueError, TypeError, AttributeError) as error:
        log.warning("%s: expected the supervisor's count of restarts: %s", name, error)
        return {}
