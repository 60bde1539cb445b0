"""Surroundings of a station on the simulated clock: the cell that outlives it, its limits, a trigger under way."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from station.channel.line import BeginReply
from station.inspection.cycle import Event
from station.inspection.deadlines import Deadlines, Pace, deadlines

from .clock import Clock
from .devices import Devices
from .inspection import RECIPE, Fruit, Inspection
from .laws import Laws
from .records import MemoryRecords, Record

LIMITS: Deadlines = deadlines(RECIPE, Pace(30.0, 1.0, 2.0, 100.0, 85.0, 0.5, 0.1))


class NoMetrics:
    """Metrics that are not read."""

    def alarms(self, active: Any) -> None:
        """Take the active alarms."""


@dataclass(slots=True)
class Cell:
    """Cell that outlives the station's process: the nest, the jaws, the disk's content."""

    clock: Clock
    rng: random.Random
    devices: Devices
    laws: Laws
    records: MemoryRecords
    carries: bool
    fruit: Fruit | None = None
    jaws_open: bool = False
    hold: Event | None = None
    """As it is in its file."""


@dataclass(slots=True)
class Pending:
    """A trigger between its request and its answer."""

    record: Record
    answer: Callable[[BeginReply], None]
    now: Inspection
