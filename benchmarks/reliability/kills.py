"""Random kills of the station's processes during inspections over the wire, some of them while a person is needed."""

import asyncio
import random
import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict

from plc_interface.plc_simulator.program import Decision, Passage

from .clock import CannotDoError
from .play import disagreements
from .rig import Rig
from .scenario import DeviceFault, ProcessFault

PROCESSES = ("service", "service", "plc", "hmi", "arm")
"""The service twice: it is what has the states."""
MOMENTS = ("inspection", "inspection", "release", "idle")
"""Within `LONGEST_S` of the accepted trigger; within `_RELEASE_S` of the result; with nothing under way."""
LONGEST_S = 6.0
"""A process is killed within this time after the trigger was accepted."""
STOPS = ("", "", "", "protective stop", "person's stop")
"""What is done before the kill."""
FRUIT = "fruit between the jaws"
_RELEASE_S = 1.5
_IDLE_S = 1.0
_PATIENCE_S = 120.0
_SHOWN_S = 5.0
"""A killed process is missed within this time."""
_STAYS_S = 1.5
_LOOK_S = 0.02
_OPENED_S = 0.2
"""Jaws that were told to open before the kill have begun to."""
_STILL_RAD, _STILL_MM = 1e-3, 0.1
_STATES = {"held": FRUIT, "aborted": "protective stop", "stopped": "person's stop"}
"""PackML's states for what only a person may end."""
_ALARMS = {FRUIT: "fruit_held", "protective stop": "protective_stop"}
_NOT_ACCEPTED = {Decision.REFUSED, Decision.NO_ANSWER}


_HEAD = """# Kills during inspections

`./run bench kills --wire N` adds N kills to this page: the whole station with the simulated cell and a PLC on the wire.
One process is killed (SIGKILL) at a random moment within 6 s of an accepted trigger, within 1.5 s of the result, while
the jaws open or the arm carries the fruit, or with nothing under way; there the next trigger follows at once. Before
two in five kills the arm stops protectively or a person stops the station at the panel. Afterwards: one outcome for
each trigger, the same in the records, and acknowledged; what only a person may end is still held, nothing moves in it,
and the person's recovery and reset lead on. The arm carries the fruit to its place in every second station, where a
kill of the service with a judged fruit between the jaws has to be held too. `--seed S` repeats a station's kills.
[Kills of the records alone](records-kills.md) have a page of their own.

A trigger that comes while the station does not miss the killed process yet gets no inspection: the PLC reads a refusal,
or no answer in time, and diverts the fruit.
"""


class Kill(BaseModel):
    """One kill and what came of it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int
    number: int
    """Of the kill, since the station with this seed was started."""
    process: str
    """Empty where what is wrong came before the kill."""
    moment: str
    state: str
    """PackML's, as the PLC read it last before the kill."""
    outcome: str
    """The PLC's decision; empty where nothing was triggered."""
    held: str
    """What a person had to end afterwards; empty for nothing."""
    took_s: float
    wrong: tuple[str, ...]


class _Plan(NamedTuple):
    process: Literal["service", "plc", "hmi", "arm"]
    moment: str
    after_s: float
    stop: str
    stop_s: float


class _Stuck(Exception):  # noqa: N818 (no error of the program's)
    """The station does not come back."""


class _Run:
    """One kill in a running station."""

    def __init__(self, rig: Rig, plan: _Plan) -> None:
        self.rig, self.wire, self.plan = rig, rig.wire, plan
        self.accepted, self.passages = len(rig.wire.accepted), len(rig.wire.passages)
        self.state, self.killed, self.held = "", False, ""
        self.wrong: list[str] = []

    async def make(self) -> None:
        """Kill, have the person do his part, and wait until the line can go on.

        Raises:
            _Stuck: it cannot.
            CannotDoError: the process is not there.
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
        await asyncio.sleep(plan.after_s)
        must_hold = await self._kill()
        if idle and triggers:
            await self.rig.lay_and_trigger()
        if triggers:
            await _until(lambda: self._gone > 0, "the line gets no outcome")
        if idle and triggers and self.wire.passages[-1].decision in _NOT_ACCEPTED:
            await self._missed()
        self.held = await self._needs_person()
        if must_hold and not self.held:
            self.wrong.append(f"{must_hold} was forgotten")
        if self.held:
            await self._person()
        await _until(lambda: wire.ready, f"not ready again ({wire.standing})")
        self._check_outcome(1 if triggers else 0, may_be_refused=idle)

    @property
    def _gone(self) -> int:
        return len(self.wire.passages) - self.passages

    async def _trigger(self) -> None:
        await self.rig.lay_and_trigger()
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

    async def _kill(self) -> str:
        """Kill the process; what has to be held afterwards."""
        wire, plan = self.wire, self.plan
        self.state, shown = wire.packml, wire.ready
        idle = plan.moment == "idle"
        judged = self._gone > 0 or wire.result_valid
        await self.rig.begin(ProcessFault(process=plan.process, signal="SIGKILL"))
        self.killed = True
        await asyncio.sleep(0.0 if idle else _OPENED_S)
        carried = (
            self.rig.configuration.service.placing == "arm"
            and plan.process == "service"
            and judged
            and not await self.rig.jaws_open()
        )
        if shown and not idle and plan.process != "hmi":
            await self._missed()
        return plan.stop or (FRUIT if carried or (self.state == "held" and "fruit_held" in wire.alarms) else "")

    async def _missed(self) -> None:
        """Wait until the killed process is missed: the readiness that is read may be from before the kill."""
        since_s = time.monotonic()
        while self.wire.ready and time.monotonic() - since_s < _SHOWN_S:
            await asyncio.sleep(_LOOK_S)

    async def _needs_person(self) -> str:
        """What the station, once it answers again, waits for a person with; empty where it does not."""
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

    async def _person(self) -> None:
        """See that nothing moves, then lead on."""
        before = await self.rig.twin(do="state")
        await asyncio.sleep(1.0)
        after = await self.rig.twin(do="state")
        if max(abs(a - b) for a, b in zip(before["arm_rad"], after["arm_rad"], strict=True)) > _STILL_RAD:
            self.wrong.append("the arm moves while held")
        if abs(before["width_mm"] - after["width_mm"]) > _STILL_MM:
            self.wrong.append("the jaws move while held")
        await self.rig.twin(do="remove")
        if self.held == "protective stop":
            await self.rig.carry_out("recover protective-stop")
        if not await self.rig.carry_out("reset"):
            self.wrong.append("the person's reset was not carried out")

    def _check_outcome(self, expected: int, *, may_be_refused: bool) -> None:
        if self._gone != expected:
            self.wrong.append(f"{self._gone} outcomes for {expected} fruit")
        for passage in self.wire.passages[self.passages :]:
            if passage.decision in _NOT_ACCEPTED and not may_be_refused:
                self.wrong.append(f"{passage.decision} to an accepted trigger")


async def kill_once(rig: Rig, chance: random.Random, seed: int, number: int) -> Kill:
    """Kill a process, most times while a fruit is inspected, and see that everything holds and the line goes on.

    Args:
        rig: ready for a trigger.
        chance: decides what is killed, and when.
        seed: of `chance`.
        number: of the kill.
    """
    process, moment, stop = chance.choice(PROCESSES), chance.choice(MOMENTS), chance.choice(STOPS)
    longest_s = {"inspection": LONGEST_S, "release": _RELEASE_S, "idle": _IDLE_S}[moment]
    plan = _Plan(process, moment, chance.uniform(0.0, longest_s), stop, chance.uniform(0.0, longest_s / 2))
    began_s, run = time.monotonic(), _Run(rig, plan)
    try:
        await run.make()
    except (_Stuck, CannotDoError) as stuck:
        run.wrong.append(str(stuck))
    run.wrong += disagreements(rig, run.accepted)
    gone = rig.wire.passages[run.passages :]
    rig.wire.forget_alarms()
    return Kill(
        seed=seed,
        number=number,
        process=process if run.killed else "",
        moment=moment,
        state=run.state,
        outcome=_outcome(gone[-1]) if gone else "",
        held=run.held,
        took_s=round(time.monotonic() - began_s, 1),
        wrong=tuple(run.wrong),
    )


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


def markdown(kills: Sequence[Kill]) -> str:
    """The page.

    Args:
        kills: all that were made.
    """
    made = [kill for kill in kills if kill.process]
    wrong = Counter(line for kill in kills for line in kill.wrong)
    processes = sorted(set(PROCESSES))
    count = Counter((kill.moment, kill.state, kill.process) for kill in made)
    places = sorted({(kill.moment, kill.state) for kill in made})
    seeds = Counter(kill.seed for kill in made)
    bad = sum(bool(kill.wrong) for kill in kills)
    held = sorted(Counter(kill.held for kill in made if kill.held).items())
    outcomes = sorted(Counter(kill.outcome for kill in made if kill.outcome).items())
    median_s = sorted(kill.took_s for kill in made)[len(made) // 2] if made else 0.0
    lines = [
        _HEAD,
        f"{len(made)} kills, {bad} times something wrong; {median_s:.0f} s each in the middle.",
        "",
        f"| moment | state that the PLC read | {' | '.join(processes)} |",
        f"| --- | --- |{' --- |' * len(processes)}",
        *(
            f"| {moment} | {state or 'none'} | {' | '.join(str(count[moment, state, each]) for each in processes)} |"
            for moment, state in places
        ),
        "",
        "| ended by a person afterwards | kills |",
        "| --- | --- |",
        *(f"| {name} | {number} |" for name, number in held),
        "",
        "| outcome | fruits |",
        "| --- | --- |",
        *(f"| {name} | {number} |" for name, number in outcomes),
        "",
        "| wrong | times |",
        "| --- | --- |",
        *(f"| {line} | {number} |" for line, number in sorted(wrong.items())),
        *([] if wrong else ["| nothing | 0 |"]),
        "",
        "Seeds, each with its kills: " + ", ".join(f"{seed} ({number})" for seed, number in sorted(seeds.items())),
        "",
    ]
    return "\n".join(lines)
