"""Play of one story: the line's real PLC program against interface and station, and the laws at every step."""

import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

from plc_interface.handshake.journal import Journal
from plc_interface.plc_simulator.faults import FaultPlan, LineFault
from plc_interface.plc_simulator.program import LineProgram
from station.inspection.states import State
from station.runtime.alarms import manager

from .cell import Cell
from .clock import Clock
from .devices import Devices
from .inspection import RECIPE, Fruit, draw_fruit
from .interface import Interface, Machine
from .laws import ALARMS_RETURN, LawBrokenError, Laws
from .records import MemoryRecords
from .station import Station
from .story import Story, Trouble

SCAN_S = 0.15
_SETTLE_S = 400.0
"""For the line to come to rest after the last trouble; an alarm that chatters stays for a minute."""

LAST_FRUITS = 3
"""Sound ones after the last trouble: a line that runs again shows it by them."""


class _Plan(FaultPlan):
    """The PLC's mistakes of a story."""

    def __init__(self, troubles: tuple[Trouble, ...]) -> None:
        super().__init__()
        self._by_fruit = {each.fruit: LineFault(each.kind) for each in troubles if each.kind != "pause"}

    def of_fruit(self, number: int) -> LineFault | None:
        return self._by_fruit.get(number)


@dataclass(slots=True)
class Report:
    """Result of a play: triggers, decisions, simulated time, and the broken law."""

    triggers: int = 0
    """Given by the PLC, refused ones among them."""
    decided: Counter[str] = field(default_factory=Counter)
    by_trouble: dict[str, Counter[str]] = field(default_factory=dict)
    """Decisions on the fruits that were there while a trouble was, by its name."""
    virtual_s: float = 0.0
    broken: LawBrokenError | None = None


def play(story: Story, hook: Callable[[Station], None] = lambda _: None) -> Report:
    """Play a story to its end, or to the first broken law.

    Args:
        story: the seed, the fruits and the troubles.
        hook: gets every new process of the station, to break something on purpose.
    """
    report = Report()
    world = _World(story, report, hook)
    with mock.patch.object(manager, "time", world.clock):
        try:
            world.run()
        except LawBrokenError as broken:
            report.broken = broken
    report.virtual_s = world.clock.s
    return report


class _World:
    def __init__(self, story: Story, report: Report, hook: Callable[[Station], None]) -> None:
        self._story, self._report, self._hook = story, report, hook
        self.clock, self._rng = Clock(), random.Random(story.seed)
        self._devices = Devices(self.clock, self._rng, story.troubles)
        records = MemoryRecords()
        self._laws = Laws(RECIPE, records)
        self._cell = Cell(self.clock, self._rng, self._devices, self._laws, records, story.carries)
        self._boots = 0
        self._program = LineProgram(_Plan(tuple(each for each in story.troubles if each.part == "plc")), lot="VIRTUAL")
        self._inputs: dict[str, Any] | None = None
        self._decided = self._wanted = self._fruits = 0
        self._leaves = False  # the fruit in the nest is decided
        self._came_s = 0.0

    def run(self) -> None:
        """Play, and wait for rest."""
        self._machine = Machine(self.clock, self._rng, self._devices, self._laws, self._new_station(), Journal())
        self._interface = Interface(self._machine)
        for trouble in self._story.troubles:
            if trouble.kind == "kill":
                self.clock.after(trouble.at_s, self._killer(trouble))
            elif trouble.part == "clock":
                self.clock.after(trouble.at_s, self._jump(trouble))
        self._scan()
        self._play(self._story.fruits, self._story.calm_s + 30.0 * self._story.fruits + _SETTLE_S)
        self.clock.run(self._story.calm_s, lambda: False)
        self._play(self._story.fruits + LAST_FRUITS, self.clock.s + _SETTLE_S)
        self.clock.run(self.clock.s + _SETTLE_S, self._is_at_rest)
        if not self._is_at_rest():
            alarms = self._machine.station.alarms.alarms.not_normal
            names = ", ".join(f"{alarm.id} {alarm.state}" for alarm in alarms)
            raise LawBrokenError(ALARMS_RETURN, f"{self._machine.station.state}, alarms: {names or 'none'}")
        self._laws.ended(self._program.counters.doubled)

    def _play(self, fruits: int, until_s: float) -> None:
        """Bring fruits until so many are decided."""
        self._wanted = fruits
        if not self.clock.run(until_s, lambda: self._decided >= fruits):
            raise LawBrokenError(ALARMS_RETURN, f"only {self._decided} of {fruits} fruits after {until_s:.0f} s")

    def _is_at_rest(self) -> bool:
        station = self._machine.station
        if self.clock.s < self._story.calm_s or not self._program.free or station.state is not State.IDLE:
            return False
        station.alarms.acknowledge_returned()
        station.alarms.reset()
        return not station.alarms.alarms.not_normal and not self._cell.records.open(None).outcomes

    def _new_station(self) -> Station:
        self._boots += 1
        station = Station(self._cell, self._boots)
        self._hook(station)
        return station

    def _killer(self, trouble: Trouble) -> Callable[[], None]:
        def revive() -> None:
            if trouble.part == "station":
                self._machine.station = self._new_station()
            else:
                self._interface = Interface(self._machine)

        def kill() -> None:
            one = self._machine.station if trouble.part == "station" else self._interface
            if one.alive:
                one.kill()
                self.clock.after(trouble.lasts_s, revive)

        return kill

    def _jump(self, trouble: Trouble) -> Callable[[], None]:
        def jump() -> None:
            self.clock.utc_offset_s += 7200.0 if trouble.kind == "forward" else -7200.0

        return jump

    def _scan(self) -> None:
        """Run one scan of the PLC, and the exchange after it."""
        self.clock.after(SCAN_S, self._scan)
        if self._devices.trouble("plc") == "pause":
            return
        room = self._cell.fruit is None or self._leaves
        if self._program.free and room and self._fruits < self._wanted:
            self._take_away()  # the next one pushes it out
            self._fruits += 1
            fruit = draw_fruit(self._fruits, self._rng)
            if self._fruits > self._story.fruits:
                fruit = Fruit(self._fruits, 35.0, 26.0, off_middle=False)
            self._cell.fruit = fruit
            self._came_s = self.clock.s
        waits = self._cell.fruit is not None and not self._leaves
        encoder = int(self.clock.s * 1000)
        outputs = self._program.scan(self._inputs, self.clock.s, fruit_in_nest=waits, encoder=encoder)
        interface = self._interface
        if not interface.alive:
            self._inputs = None
        else:
            if self._program.cut_wanted:
                interface.disconnect()
            if not interface.has_writer:
                interface.connect()
            interface.write(outputs)
            self._inputs = dict(interface.registers)
        for passage in self._program.take_passages():
            self._laws.passed(passage)
            self._note(str(passage.decision))
            self._decided += 1
            self._leaves = True
        if self._program.may_move:
            self._take_away()

    def _take_away(self) -> None:
        if self._leaves and self._cell.fruit is not None:
            self._laws.moved(self._cell.fruit.number, jaws_open=self._cell.jaws_open)
            self._cell.fruit, self._leaves = None, False

    def _note(self, decision: str) -> None:
        self._report.triggers += 1
        self._report.decided[decision] += 1
        there = {
            each.name
            for each in self._story.troubles
            if (each.part == "plc" and each.kind != "pause" and each.fruit == self._fruits)
            or (each.name[:4] != "plc " and each.at_s < self.clock.s and each.at_s + each.lasts_s > self._came_s)
            or (each.kind == "pause" and each.at_s < self.clock.s and each.at_s + each.lasts_s > self._came_s)
        }
        for name in there or {"no trouble"}:
            self._report.by_trouble.setdefault(name, Counter())[decision] += 1
