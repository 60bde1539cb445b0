"""Random kills of the station's processes during inspections over the wire, some of them while a person is needed."""

import asyncio
import random
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Literal, NamedTuple

from plc_interface.plc_simulator.program import Decision, Passage
from station.records.audit_check import check_trail
from station.records.database import plain, reading
from station.records.integrity_check import check_records
from station.supervision.supervisor import RESTARTS, RESTARTS_WITHIN_S

from .clock import CannotDoError
from .kills_page import Kill, Round, Station
from .play import disagreements
from .rig import Rig
from .scenario import DeviceFault, ProcessFault

Process = Literal["service", "plc", "hmi", "arm"]
_PROCESSES: tuple[Process, ...] = ("service", "service", "plc", "hmi", "arm")
"""The service twice: it is what has the states."""
_MOMENTS = {"inspection": 4.0, "release": 3.0, "idle": 1.0}
"""A process is killed within this time after the accepted trigger, after its result, or with nothing under way; s."""
_STOPS = ("", "", "", "protective stop", "person's stop")
"""What is done before the kill."""
_BRUISED = 0.3
_AGAIN_S = 3.0
_IN_HOLD_S = 1.0
_FRUIT = "fruit between the jaws"
_PATIENCE_S = 120.0
_SHOWN_S = 5.0
"""A killed process is missed within this time."""
_STAYS_S = 1.5
_LOOK_S = 0.02
_OPENED_S = 0.2
"""Jaws with an order to open before the kill have started to."""
_OPENING_S = 0.1
_STILL_RAD, _STILL_MM = 1e-3, 0.1
_STATES = {"held": _FRUIT, "aborted": "protective stop", "stopped": "person's stop"}
"""PackML's states for what only a person may end."""
_ALARMS = {_FRUIT: "fruit_held", "protective stop": "protective_stop"}
_NOT_ACCEPTED = {Decision.REFUSED, Decision.NO_ANSWER}
_JUDGED = {"PASS", "FAIL"}


class Restarts:
    """Kills of one station's processes that the supervisor, which gives up at too many, still has in mind."""

    def __init__(self) -> None:
        self._killed_s: dict[str, deque[float]] = {}

    async def spare(self, processes: Sequence[str]) -> None:
        """Wait until all of these may be killed."""
        for process in {*processes} - {"arm"}:  # which the service starts again, as often as it takes
            killed_s = self._killed_s.setdefault(process, deque(maxlen=RESTARTS))
            while True:
                now_s = time.monotonic()
                recent = sum(now_s - each < RESTARTS_WITHIN_S + _SHOWN_S for each in killed_s)
                if recent + processes.count(process) <= RESTARTS:
                    break
                await asyncio.sleep(_LOOK_S)

    def note(self, process: str) -> None:
        """Note a kill."""
        self._killed_s.setdefault(process, deque(maxlen=RESTARTS)).append(time.monotonic())


class _Planned(NamedTuple):
    process: Process
    after_s: float


class _Plan(NamedTuple):
    bruised: bool
    moment: str
    stop: str
    stop_s: float
    kills: tuple[_Planned, ...]
    in_hold: tuple[_Planned, ...]


class _Stuck(Exception):  # noqa: N818 (no error of the program's)
    """The station does not come back."""


class _Run:
    """One round in a running station."""

    def __init__(self, rig: Rig, plan: _Plan, restarts: Restarts) -> None:
        self.rig, self.wire, self.plan, self._restarts = rig, rig.wire, plan, restarts
        self.accepted, self.passages = len(rig.wire.accepted), len(rig.wire.passages)
        self.kills: list[Kill] = []
        self.held = self._must_hold = ""
        self._closed_mm: float | None = None
        self.wrong: list[str] = []

    async def make(self) -> None:
        """Kill, have the person do his part, and wait until the line can go on.

        Raises:
            _Stuck: it cannot.
            CannotDoError: a process is not there.
        """
        plan, wire = self.plan, self.wire
        idle = plan.moment == "idle"
        triggers = not (idle and plan.stop)
        await _until(lambda: wire.ready, "not ready for the fruit")
        if not idle:
            await self._trigger()
        if plan.moment == "release":
            await _until(lambda: wire.result_valid or self._gone > 0, "no result")
        if plan.stop:
            await asyncio.sleep(plan.stop_s)
            await self._stop()
        await self._kill(plan.kills[0], plan.moment, at_once=idle)
        if idle and triggers:
            await self.rig.lay_and_trigger(bruised=plan.bruised)
        for planned in plan.kills[1:]:
            await self._kill(planned, "again")
        if triggers:
            await _until(lambda: self._gone > 0, "the line gets no outcome")
        if idle and triggers and wire.passages[-1].decision in _NOT_ACCEPTED:
            await self._missed()
        self.held = await self._needs_person()
        if self._must_hold and not self.held:
            self.wrong.append(f"{self._must_hold} was forgotten")
        if self.held:
            await self._kill_in_hold()
            await self._person()
        await _until(lambda: wire.ready, f"not ready again ({wire.standing})")
        self._check_outcome(1 if triggers else 0, may_be_refused=idle)

    @property
    def _gone(self) -> int:
        return len(self.wire.passages) - self.passages

    @property
    def _judged(self) -> bool:
        accepted = self.wire.accepted[self.accepted :]
        results = (shown for results in self.wire.shown.values() for shown in results)
        return any(shown.trigger_id in accepted and shown.outcome in _JUDGED for shown in results)

    async def _trigger(self) -> None:
        await self.rig.lay_and_trigger(bruised=self.plan.bruised)
        await _until(lambda: len(self.wire.accepted) > self.accepted or self._gone > 0, "the trigger is not answered")
        if self._gone and self.wire.passages[-1].decision in _NOT_ACCEPTED:
            raise _Stuck(f"the trigger is not accepted: {_outcome(self.wire.passages[-1])}")

    async def _stop(self) -> None:
        if self.plan.stop == "protective stop":
            stop = DeviceFault(device="arm", fault="protective_stop")
            await self.rig.begin(stop)
            await self.rig.end(stop)
            await _until(lambda: self.wire.packml == "aborted", "a safety stop is not shown")
        elif not await self.rig.stop_at_the_panel():
            raise _Stuck("a person's stop is not shown")
        self._must_hold = self.plan.stop

    async def _kill(self, planned: _Planned, moment: str, *, at_once: bool = False) -> None:
        """Kill a process, and note what has to be held afterwards."""
        await asyncio.sleep(planned.after_s)
        wire, process = self.wire, planned.process
        shown, judged = wire.ready, self._judged
        held = wire.packml == "held" and "fruit_held" in wire.alarms
        await self._signal(process, moment)
        if at_once:
            return
        if held and not self._must_hold:
            self._must_hold = _FRUIT
        await asyncio.sleep(_OPENED_S)
        if judged and process in {"service", "arm"} and self.rig.configuration.service.placing == "arm":
            await self._must_hold_fruit()
        if shown and process != "hmi":
            await self._missed()

    async def _signal(self, process: Process, moment: str) -> None:
        """Kill; where the process is between two starts, as soon as there is one."""
        ends_s = time.monotonic() + _PATIENCE_S
        while True:
            state = self.wire.packml
            try:
                await self.rig.begin(ProcessFault(process=process, signal="SIGKILL"))
            except CannotDoError:
                if time.monotonic() > ends_s:
                    raise
                await asyncio.sleep(_LOOK_S)
            else:
                break
        self._restarts.note(process)
        self.kills.append(Kill(process=process, moment=moment, state=state))

    async def _must_hold_fruit(self) -> None:
        """Note that a person has to take a judged fruit, where it is between jaws that do not open."""
        before_mm = (await self.rig.twin(do="state"))["width_mm"]
        await asyncio.sleep(_OPENING_S)
        if not await self.rig.jaws_open() and self._closed_mm is None:
            now_mm = (await self.rig.twin(do="state"))["width_mm"]
            if abs(now_mm - before_mm) < _STILL_MM:
                self._closed_mm, self._must_hold = now_mm, self._must_hold or _FRUIT

    async def _missed(self) -> None:
        """Wait until the killed process is missed: the readiness that is read may be from before the kill."""
        since_s = time.monotonic()
        while self.wire.ready and time.monotonic() - since_s < _SHOWN_S:
            await asyncio.sleep(_LOOK_S)

    async def _needs_person(self) -> str:
        """Return the cause why the station, once it responds again, waits for a person; empty where it does not."""
        wire, last, since_s = self.wire, "", 0.0
        ends_s = time.monotonic() + _PATIENCE_S
        while time.monotonic() < ends_s:
            if wire.ready:
                return ""
            now = _STATES.get(wire.packml, "")
            if now == "person's stop" and self.plan.stop != now:
                now = ""
            if now in _ALARMS and _ALARMS[now] not in wire.alarms:
                now = ""
            if now != last:
                last, since_s = now, time.monotonic()
            if now and time.monotonic() - since_s > _STAYS_S:
                return now
            await asyncio.sleep(_LOOK_S)
        raise _Stuck(f"neither ready nor held ({wire.standing})")

    async def _kill_in_hold(self) -> None:
        """Kill while the person is waited for."""
        for planned in self.plan.in_hold:
            await self._kill(planned, "held")
            now = await self._needs_person()
            if now != self.held:
                raise _Stuck(f"{self.held} was {now or 'nothing'} after another kill")

    async def _person(self) -> None:
        """See that nothing moves, then lead on."""
        before = await self.rig.twin(do="state")
        await asyncio.sleep(1.0)
        after = await self.rig.twin(do="state")
        if max(abs(a - b) for a, b in zip(before["arm_rad"], after["arm_rad"], strict=True)) > _STILL_RAD:
            self.wrong.append("the arm moves while held")
        if abs(before["width_mm"] - after["width_mm"]) > _STILL_MM:
            self.wrong.append("the jaws move while held")
        if self._closed_mm is not None and after["width_mm"] - self._closed_mm > _STILL_MM:
            self.wrong.append("the jaws let the fruit go before a person came")
        await self.rig.twin(do="remove")
        if self.held == "protective stop":
            await self.rig.carry_out("recover protective-stop")
        if not await self.rig.carry_out("start" if self.held == "person's stop" else "reset"):
            self.wrong.append("the person's reset was not carried out")

    def _check_outcome(self, expected: int, *, may_be_refused: bool) -> None:
        if self._gone != expected:
            self.wrong.append(f"{self._gone} outcomes for {expected} fruit")
        for passage in self.wire.passages[self.passages :]:
            if passage.decision in _NOT_ACCEPTED and not may_be_refused:
                self.wrong.append(f"{passage.decision} to an accepted trigger")
            if passage.decision is (Decision.PASS if self.plan.bruised else Decision.FAIL):
                self.wrong.append(f"{passage.decision} for a {'bruised' if self.plan.bruised else 'sound'} fruit")


async def kill_in_round(rig: Rig, chance: random.Random, restarts: Restarts, seed: int, number: int) -> Round:
    """Kill processes while a fruit is inspected, and see that everything holds and the line goes on.

    Args:
        rig: ready for a trigger.
        chance: decides what is killed, and when.
        restarts: the station's.
        seed: of `chance`.
        number: of the round.
    """
    plan = _draw(chance)
    await restarts.spare([each.process for each in (*plan.kills, *plan.in_hold)])
    began_s, run = time.monotonic(), _Run(rig, plan, restarts)
    try:
        await run.make()
    except (_Stuck, CannotDoError) as stuck:
        run.wrong.append(str(stuck))
    run.wrong += disagreements(rig, run.accepted)
    gone = rig.wire.passages[run.passages :]
    rig.wire.forget_alarms()
    return Round(
        seed=seed,
        number=number,
        placing=rig.configuration.service.placing,
        bruised=plan.bruised,
        kills=tuple(run.kills),
        outcome=_outcome(gone[-1]) if gone else "",
        held=run.held,
        took_s=round(time.monotonic() - began_s, 1),
        wrong=tuple(run.wrong),
    )


def check_station(folder: Path, seed: int) -> Station:
    """Check a station's records after its end.

    Args:
        folder: the records'.
        seed: of the station.
    """
    found = check_records(folder)
    known = check_trail(folder).notes  # a kill between a row and its signature is noted by the next start
    wrong = [*found.faults, *(note for note in found.notes if note not in known)]
    with reading(folder) as connection, closing(plain(connection).cursor()) as cursor:
        questions = {
            "inspections without an outcome that the PLC acknowledged": "SELECT count(*) FROM inspections "
            "WHERE outcome IS NULL OR published_utc_ms IS NULL OR acknowledged_utc_ms IS NULL",
            "inspections not in the outbox": "SELECT count(*) FROM inspections WHERE sequence NOT IN "
            "(SELECT row FROM outbox WHERE kind = 'inspection')",
        }
        for what, question in questions.items():
            (number,) = cursor.execute(question).fetchone()
            wrong += [f"{number} {what}"] if number else []
        (rows,) = cursor.execute("SELECT count(*) FROM audit").fetchone()
    return Station(seed=seed, inspections=found.inspections, images=found.images, audit_rows=rows, wrong=tuple(wrong))


def _draw(chance: random.Random) -> _Plan:
    moment, stop = chance.choice(("inspection", "inspection", "release", "release", "idle")), chance.choice(_STOPS)
    longest_s = _MOMENTS[moment]
    first = _Planned(chance.choice(_PROCESSES), chance.uniform(0.0, longest_s))
    again = [
        _Planned(chance.choice(_PROCESSES), chance.uniform(0.0, _AGAIN_S)) for _ in range(chance.choice((0, 1, 1, 2)))
    ]
    in_hold = [
        _Planned(chance.choice(_PROCESSES), chance.uniform(0.0, _IN_HOLD_S)) for _ in range(chance.choice((0, 1, 2)))
    ]
    stop_s, bruised = chance.uniform(0.0, longest_s / 2), chance.random() < _BRUISED
    return _Plan(bruised, moment, stop, stop_s, (first, *again), tuple(in_hold))


def _outcome(passage: Passage) -> str:
    """The decision, with the refusal's reason."""
    refused = passage.decision is Decision.REFUSED
    return f"{passage.decision}: {', '.join(passage.reasons)}" if refused else passage.decision.value


async def _until(holds: Callable[[], bool], otherwise: str) -> None:
    ends_s = time.monotonic() + _PATIENCE_S
    while not holds():
        if time.monotonic() > ends_s:
            raise _Stuck(otherwise)
        await asyncio.sleep(_LOOK_S)
