"""Line simulation: fruit arriving at the nest, the PLC's program scanning, and the decision on each fruit."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from plc_interface.plc_simulator.nest import LaidFruit, Nest
from plc_interface.plc_simulator.program import Decision, LineProgram, Outputs, Passage, Values
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.registers.alarms import active_alarms

_ENCODER_COUNTS_PER_S = 1000.0


@dataclass(frozen=True, slots=True)
class Pace:
    """Timing of the line."""

    scan_s: float = 0.01
    every_s: float = 0.0
    """Time from one fruit's arrival to the next. One that the nest is not free for waits, and the next behind it."""


@dataclass(slots=True)
class Summary:
    """Counts of the line, and of right decisions where the truth is known."""

    decided: dict[Decision, int] = field(default_factory=lambda: dict.fromkeys(Decision, 0))
    damaged_passed: int = 0
    sound_diverted: int = 0
    waits_s: list[float] = field(default_factory=list)
    """How long each fruit waited before the nest."""

    @property
    def fruits(self) -> int:
        """Number of decided fruit."""
        return sum(self.decided.values())

    def add(self, passage: Passage, fruit: LaidFruit) -> None:
        """Count one fruit by the line's decision and its true state."""
        self.decided[passage.decision] += 1
        self.damaged_passed += fruit.damaged is True and not passage.diverted
        self.sound_diverted += fruit.damaged is False and passage.diverted


class LineSimulator:
    """Simulation of a line against a station."""

    def __init__(self, program: LineProgram, scanner: Scanner, nest: Nest, pace: Pace) -> None:
        self._program, self._scanner, self._nest, self._pace = program, scanner, nest, pace
        self.on_passage: Callable[[Passage, LaidFruit], None] = lambda _passage, _fruit: None
        """Gets each fruit when it is decided."""
        self.on_scan: Callable[[str], None] = lambda _activity: None
        """Receives after each scan the line's activity, or its obstacle."""
        self.summary = Summary()
        self._written: Outputs | None = None

    async def run(self, count: int | None) -> Summary:
        """Run until `count` fruits are decided and the last one has left; None for until cancelled.

        A fruit leaves where the arm has left. One that waits behind it takes its place as soon as the jaws are open, so
        that the line is as fast as the station.

        Raises:
            StationError: the nest cannot be filled.
        """
        inputs = None
        fruit: LaidFruit | None = None
        leaves = False  # a decided fruit is still in the nest
        next_arrival_s = due_s = time.monotonic()
        while count is None or self.summary.fruits < count or leaves or not self._program.free:
            now_s = time.monotonic()
            wanted = count is None or self.summary.fruits < count
            if fruit is None and wanted and self._program.free and now_s >= next_arrival_s:
                fruit, leaves = await self._nest.arrive(), False  # into the place of the one before
                self.summary.waits_s.append(now_s - next_arrival_s if self._pace.every_s else 0.0)
                next_arrival_s = next_arrival_s + self._pace.every_s if self._pace.every_s else now_s
            encoder = int(now_s * _ENCODER_COUNTS_PER_S) % 2**32
            outputs = self._program.scan(
                inputs,
                now_s,
                fruit_in_nest=fruit is not None,
                recipe=fruit.recipe if fruit else 0,
                encoder=encoder,
                fruit_length_mm_x10=fruit.length_mm_x10 if fruit else 0,
            )
            if self._program.cut_wanted:
                self._scanner.cut()
            self._written = outputs
            inputs = await self._scanner.exchange(outputs)
            self.on_scan(self._scanner.trouble or self._activity(inputs))
            for passage in self._program.take_passages():
                if fruit is not None:
                    self.summary.add(passage, fruit)
                    self.on_passage(passage, fruit)
                    fruit, leaves = None, True
            if leaves and self._program.may_move:  # at the decision the jaws still hold it
                leaves = False
                await self._nest.leave()
            due_s = max(due_s + self._pace.scan_s, time.monotonic())
            await asyncio.sleep(max(0.0, due_s - time.monotonic()))
        return self.summary

    async def release(self) -> None:
        """Clear enable and every other control bit: the station has no reason to miss this PLC once it has gone."""
        if self._written is not None:
            await self._scanner.exchange({**self._written, "control": 0})

    def _activity(self, inputs: Values | None) -> str:
        alarms = ", ".join(map(str, active_alarms(inputs))) if inputs else ""
        return f"{self._program.stage.value}; active alarms: {alarms}" if alarms else self._program.stage.value
