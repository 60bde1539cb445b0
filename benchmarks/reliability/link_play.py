"""One story: fruits in a running station, links disturbed meanwhile, laws checked after each."""

import asyncio
import contextlib
import random
import time
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Sequence
from typing import NamedTuple, Self

from plc_interface.plc_simulator.program import Decision
from station.inspection.alarm_table import AlarmId
from station.inspection.alarms import CHATTER_S
from station.records.model import FullRecord

from .link_laws import Broken, of_passage, of_records, records_since
from .link_observer import HELD, STATISTICS, Observer
from .link_results import ALARMS_RETURN, NONE_DOUBLED, NOTHING_MOVES, ONE_OUTCOME, Fruit, Story
from .link_story import Moment, Plan, Planned
from .proxy import Disturbance, Kind
from .rig import Rig
from .routes import LinkName, Routes

_PATIENCE_S = 120.0
"""The station's deadline for an inspection comes before, also with the patience of a busy machine."""
_LOOK_S = 0.01
_RECORDED_S = 10.0
"""Within this time after ready every outcome is acknowledged in the records."""
_NORMAL_S = CHATTER_S + 10.0
"""Within this time after the last fruit no alarm is active: one that chatters stays until it was off for so long."""
_PERSON_AFTER_S = 1.0
"""A person comes after so long in a state that waits for one."""
_STILL_RAD, _STILL_MM = 1e-3, 0.1
_SETTLED_S = 0.3
"""After a held state is shown the arm may still brake; so long it is watched."""
_SHOWN_S = 0.5
"""A motion's state is shown within this time after its begin: a beat of the channel, on a busy machine."""
_SIGN_S = 3.0
"""A sign this late after a disturbance's end is of something else: the longest time-out is 2 s."""


class _Stuck(Exception):  # noqa: N818 (no error of the program's)
    """The line does not go on."""


class _Before(NamedTuple):
    """Counts of the line before a fruit."""

    passages: int
    losses: int
    doubled: int
    accepted: int


class _Disturbing:
    """The disturbance of one fruit, which may not have started, and does not outlast the block."""

    def __init__(self, routes: Routes, planned: Planned | None) -> None:
        self._routes, self._planned = routes, planned
        self.now: Disturbance | None = None
        self._task: asyncio.Task[None] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._task is not None:
            self._task.cancel()

    def begin(self) -> None:
        """Begin it, if there is one."""
        planned = self._planned
        if planned is not None:
            self.now = Disturbance(planned.kind, planned.way, planned.lasts_s, random.Random(planned.seed))
            self._task = asyncio.create_task(self._routes.links[planned.link].disturb(self.now), name="disturbance")

    async def over(self) -> None:
        """Wait for its end."""
        if self._task is not None:
            await self._task


class Player:
    """Plays stories' fruits in one station.

    Args:
        rig: running.
        routes: its links.
        seed: of the story.
    """

    def __init__(self, rig: Rig, routes: Routes, seed: int) -> None:
        self._rig, self._routes, self._seed = rig, routes, seed
        self._wire, self._triggering = rig.wire, False
        self._observer = Observer(rig.configuration.modbus, lambda: not self._triggering)
        self._sequence = 0

    @contextlib.asynccontextmanager
    async def observed(self) -> AsyncIterator[None]:
        """Observe the interface for as long as the block lasts."""
        observing = asyncio.create_task(self._observer.run(), name="observer")
        try:
            yield
        finally:
            observing.cancel()
            await asyncio.gather(observing, return_exceptions=True)

    async def fruit(self, number: int, plan: Plan) -> Fruit:
        """Bring one fruit, and see what comes of it; the story ends where `broken` names a line that does not go on.

        Args:
            number: of the fruit.
            plan: what is done.
        """
        planned, began_s = plan.disturbance, time.monotonic()
        row = Fruit(seed=self._seed, number=number, bruised=plan.bruised)
        if planned is not None:
            row.link, row.kind, row.way = planned.link.value, planned.kind.value, planned.way.value
            row.moment, row.plan = planned.moment.value, str(planned)
        broken = list[Broken]()
        try:
            await self._play(row, plan, broken)
        except _Stuck as stuck:
            broken.append((ALARMS_RETURN, str(stuck)))
        row.alarms = tuple(sorted(self._observer.seen - STATISTICS))
        row.broken = tuple(broken)
        row.took_s = round(time.monotonic() - began_s, 2)
        return row

    async def at_the_end(self) -> list[Broken]:
        """Check that every alarm has returned to normal."""
        await _until(lambda: not self._active, _NORMAL_S)
        return [(ALARMS_RETURN, f"alarm {alarm} is active at the end") for alarm in sorted(self._active)]

    @property
    def _active(self) -> set[AlarmId]:
        return self._observer.alarms - STATISTICS

    async def _play(self, row: Fruit, plan: Plan, broken: list[Broken]) -> None:
        wire, observer = self._wire, self._observer
        await self._ready(row, broken)
        observer.forget()
        before = _Before(len(wire.passages), wire.losses, wire.doubled, len(observer.accepted))
        with _Disturbing(self._routes, plan.disturbance) as disturbing:
            await self._inspect(row, plan, broken, before, disturbing)
            decided_s = time.monotonic()
            await disturbing.over()
            await self._ready(row, broken)
        ready_s = time.monotonic()
        passage = wire.passages[before.passages]
        row.outcome, row.reasons = passage.decision.value, passage.reasons
        if wire.losses > before.losses:
            observer.signs.setdefault("the PLC misses the station", wire.lost_s)
        if passage.decision in {Decision.REFUSED, Decision.NO_ANSWER}:
            observer.signs.setdefault(passage.decision.value, decided_s)
        broken += await self._check(row, plan, before)
        if disturbing.now is not None:
            self._times(row, disturbing.now, decided_s, ready_s)

    async def _inspect(
        self, row: Fruit, plan: Plan, broken: list[Broken], before: "_Before", disturbing: "_Disturbing"
    ) -> None:
        """Bring the fruit, trigger, disturb at the plan's moment, and wait for the PLC's decision."""
        wire, observer = self._wire, self._observer
        planned = plan.disturbance
        moment = None if planned is None else planned.moment
        if moment in {Moment.IDLE, Moment.TRIGGER}:
            disturbing.begin()
        if planned is not None and moment is Moment.IDLE:
            await asyncio.sleep(planned.lasts_s + _SETTLED_S)
        self._triggering = True
        await self._rig.lay_and_trigger(bruised=plan.bruised)

        def gone() -> bool:
            return len(wire.passages) > before.passages

        if planned is not None and moment in {Moment.INSPECTION, Moment.RESULT}:
            await self._as_ready(lambda: gone() or len(observer.accepted) > before.accepted, row, broken)
            if moment is Moment.INSPECTION:
                await _until(gone, planned.after_s)
            else:
                await self._as_ready(lambda: gone() or observer.result_valid, row, broken)
            disturbing.begin()
        await self._as_ready(gone, row, broken)
        self._triggering = False

    async def _check(self, row: Fruit, plan: Plan, before: "_Before") -> list[Broken]:
        """Check the laws on one fruit; what a corruption on Modbus made the PLC read is not the station's."""
        wire, planned = self._wire, plan.disturbance
        passage = wire.passages[before.passages]
        records = await self._recorded()
        broken = list(of_records(records, self._observer, self._rig.recipe.damage.deciding_closing_mm))
        if len(wire.passages) != before.passages + 1:
            broken.append((ONE_OUTCOME, f"{len(wire.passages) - before.passages} decisions on one fruit"))
        by_passage = list(of_passage(passage, records, bruised=plan.bruised))
        if wire.doubled > before.doubled:
            by_passage.append((NONE_DOUBLED, "a result came again after its acknowledgement"))
        if planned is not None and planned.kind is Kind.CORRUPT and planned.link is LinkName.MODBUS:
            row.misled = tuple(text for _, text in by_passage)
            return broken
        return broken + by_passage

    def _times(self, row: Fruit, disturbance: Disturbance, decided_s: float, ready_s: float) -> None:
        row.touched = disturbance.touched
        over_s = disturbance.began_s if disturbance.ended_s is None else disturbance.ended_s
        seen = self._observer.signs.items()
        own = {Decision.REFUSED.value, Decision.NO_ANSWER.value}  # which come at the PLC's own limits
        signs = {
            name: at_s
            for name, at_s in seen
            if disturbance.began_s <= at_s and (at_s <= over_s + _SIGN_S or name in own)
        }
        row.signs = tuple(sorted(signs, key=lambda name: signs[name]))
        if not signs:
            return
        first_s = min(signs.values())
        row.detected_s = round(first_s - disturbance.began_s, 3)
        fell_s = self._observer.fell_s(first_s)
        row.safe_s = None if fell_s is None else round(max(0.0, fell_s - first_s), 3)
        row.ready_s = round(max(0.0, ready_s - max(over_s, decided_s)), 2)

    async def _recorded(self) -> Sequence[FullRecord]:
        """The records since the last fruit, once all are acknowledged, or it is too late."""
        ends_s = time.monotonic() + _RECORDED_S
        while True:
            records = await asyncio.to_thread(records_since, self._rig, self._sequence)
            if all(each.acknowledged_utc_ms for each in records) or time.monotonic() > ends_s:
                self._sequence = max([self._sequence, *(each.sequence for each in records)])
                return records
            await asyncio.sleep(0.1)

    async def _ready(self, row: Fruit, broken: list[Broken]) -> None:
        await self._as_ready(lambda: self._wire.ready and self._observer.ready, row, broken)

    async def _as_ready(self, holds: Callable[[], bool], row: Fruit, broken: list[Broken]) -> None:
        """Wait for something; a person leads the station out of a state that waits for one.

        Raises:
            _Stuck: it does not come.
        """
        observer, ends_s, since_s, turns = self._observer, time.monotonic() + _PATIENCE_S, time.monotonic(), -1
        checked = False
        while not holds():
            now_s = time.monotonic()
            if now_s > ends_s:
                why = await self._rig.why_not_ready()
                raise _Stuck(f"the line does not go on: {self._wire.standing}; {observer.packml}; {why}")
            if observer.turns != turns:
                turns, since_s, checked = observer.turns, now_s, False
            waited_s = now_s - since_s
            if observer.packml in HELD and waited_s > _SETTLED_S and not checked:
                checked = True
                await self._still(broken)
            elif observer.needs_person and waited_s > _PERSON_AFTER_S:
                await self._person(row)
                since_s = time.monotonic()
            await asyncio.sleep(_LOOK_S)

    async def _still(self, broken: list[Broken]) -> None:
        """See that nothing moves."""
        observer, state, turns = self._observer, self._observer.packml, self._observer.turns
        before = await self._rig.twin(do="state")
        await asyncio.sleep(_SETTLED_S)
        after = await self._rig.twin(do="state")
        await asyncio.sleep(_SHOWN_S)
        if observer.turns != turns:
            return
        if max(abs(a - b) for a, b in zip(before["arm_rad"], after["arm_rad"], strict=True)) > _STILL_RAD:
            broken.append((NOTHING_MOVES, f"the arm moves while {state}"))
        if abs(before["width_mm"] - after["width_mm"]) > _STILL_MM:
            broken.append((NOTHING_MOVES, f"the jaws move while {state}"))

    async def _person(self, row: Fruit) -> None:
        """Lead on, as the remedies of the fault matrix do."""
        observer = self._observer
        await self._rig.twin(do="remove")
        remedies = list[str]()
        if AlarmId.PROTECTIVE_STOP in observer.alarms:
            remedies.append("recover protective-stop")
        elif observer.alarms & {AlarmId.EMERGENCY_STOP, AlarmId.SAFETY_FAULT}:
            remedies.append("recover power")
        for remedy in (*remedies, "reset"):
            await self._rig.carry_out(remedy)
            row.remedies = (*row.remedies, remedy)


async def play(rig: Rig, routes: Routes, seed: int, plans: Sequence[Plan]) -> AsyncGenerator[Fruit | Story, None]:
    """Play a story: yields each fruit, and at the end the story without its fruits.

    Args:
        rig: running and ready.
        routes: its links.
        seed: of the story.
        plans: of its fruits.
    """
    player, stuck = Player(rig, routes, seed), False
    async with player.observed():
        for number, plan in enumerate(plans, 1):
            row = await player.fruit(number, plan)
            yield row
            if stuck := any(law == ALARMS_RETURN for law, _ in row.broken):
                break
        broken = [] if stuck else await player.at_the_end()
    yield Story(seed=seed, triggers=len(rig.wire.passages), broken=tuple(broken), ended=True)


async def _until(holds: Callable[[], bool], limit_s: float) -> None:
    """Wait for something, or as long as that."""
    ends_s = time.monotonic() + limit_s
    while not holds() and time.monotonic() < ends_s:
        await asyncio.sleep(_LOOK_S)
