"""One scenario in one phase of the cycle: what was done, what the wire and the records have, what did not hold."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime

from pydantic import BaseModel, ConfigDict

from station.inspection.evidence import AT_MM
from station.records.database import reading
from station.records.errors import RecordsError
from station.records.queries import read_inspection

from .clock import CannotDoError
from .rig import Rig
from .scenario import Phase, Scenario
from .wire import Shown

_PATIENCE_S = 120.0
_STAYS_S = 3.0
_LOOK_S = 0.01
_WHY_EVERY_S = 0.3
_PASSING = ("wait a moment", "Wait until")


class Row(BaseModel):
    """Measurements of one scenario in one phase of the cycle."""

    model_config = ConfigDict(extra="forbid")

    scenario: str
    phase: str
    outcome: str = ""
    reasons: tuple[str, ...] = ()
    alarms: tuple[str, ...] = ()
    why: str = ""
    """The station's last sentence on why it was not ready, apart from those that require a short wait."""
    recovered_s: float | None = None
    """From the fault's end, or from a person's last verb, to ready again."""
    wrong: tuple[str, ...] = ()
    """What did not hold."""
    skipped: str = ""
    played_on: str = ""
    """The day, UTC, YYYY-MM-DD; empty in rows that were played before it was stored."""


async def play(rig: Rig, scenario: Scenario, phase: Phase) -> Row:
    """Play it on a ready station.

    Args:
        rig: the station.
        scenario: what.
        phase: when.
    """
    today = datetime.now(UTC).date().isoformat()
    row, wrong = Row(scenario=scenario.name, phase=phase.value, played_on=today), list[str]()
    wire = rig.wire
    accepted_before, passages_before = len(wire.accepted), len(wire.passages)
    polling = asyncio.create_task(_poll_why(rig, row), name="polling why")
    try:
        await _sure(lambda: wire.ready, lambda: f"not ready before the fault ({wire.standing})")
        wire.forget_alarms()
        if phase is Phase.APPROACH:
            await rig.watch_arm()
        if phase is Phase.LEAVING:
            await _sound_fruit(rig)
            passages_before += 1
        accepted_now = len(wire.accepted)
        await rig.lay_and_trigger()
        await _disturb(rig, scenario, phase, accepted_now, passages_before)
        cleared_s = time.monotonic()
        await _sure(lambda: len(wire.passages) > passages_before, lambda: f"the line gets no outcome ({wire.standing})")
        await _recover(rig, scenario, row, cleared_s, wrong)
        first = wire.passages[passages_before]
        row.outcome, row.reasons = first.decision.value, first.reasons
        _as_expected(row, scenario, phase, wrong)
        if not await _until(rig.jaws_open):
            wrong.append("the jaws do not stand open")
        row.alarms = tuple(sorted(wire.alarms))
        if scenario.alarm and phase is not Phase.RELEASING and scenario.alarm not in wire.alarms:
            wrong.append(f"alarm {scenario.alarm} was not raised")
        await _next_fruit(rig, wrong)
    except _Stuck as stuck:
        wrong.append(str(stuck))
    except CannotDoError as error:
        row.skipped = str(error)
    finally:
        await rig.unwatch_arm()
        await rig.hurry()
        polling.cancel()
        await asyncio.gather(polling, return_exceptions=True)
        if scenario.fault is not None:
            await rig.end(scenario.fault)
    row.alarms = tuple(sorted(wire.alarms))
    wrong += [] if row.skipped else disagreements(rig, accepted_before)
    row.wrong = tuple(wrong)
    return row


class _Stuck(Exception):  # noqa: N818 (no error of the program's)
    """The row cannot go on."""


async def _sound_fruit(rig: Rig) -> None:
    """Inspect a good fruit, up to where the next trigger would be accepted while the arm leaves slowly."""
    wire, before = rig.wire, len(rig.wire.passages)
    await rig.lay_and_trigger()
    try:
        async with asyncio.timeout(_PATIENCE_S):
            await rig.leave_slowly()
    except TimeoutError:
        raise _Stuck("the fruit before gets no outcome") from None
    await _sure(lambda: len(wire.passages) > before and wire.ready, lambda: f"not ready after it ({wire.standing})")
    if wire.passages[-1].decision.value != "PASS":
        raise _Stuck(f"the fruit before is {wire.passages[-1].decision}")
    if not wire.completing:
        raise _Stuck("the arm has left before the next trigger")


async def _disturb(rig: Rig, scenario: Scenario, phase: Phase, accepted_before: int, passages_before: int) -> None:
    if scenario.fault is None:
        return
    began_s = time.monotonic()
    while not await rig.reached(phase, accepted_before):
        if len(rig.wire.passages) > passages_before or time.monotonic() > began_s + _PATIENCE_S:
            raise _Stuck("the phase was not seen before the outcome")
        await asyncio.sleep(_LOOK_S)
    await rig.unwatch_arm()
    await rig.begin(scenario.fault)
    await asyncio.sleep(scenario.lasts_s)
    await rig.end(scenario.fault)
    await rig.hurry()


async def _recover(rig: Rig, scenario: Scenario, row: Row, since_s: float, wrong: list[str]) -> None:
    if scenario.remedy:
        if await _until(_now(lambda: rig.wire.ready), _STAYS_S):
            wrong.append("came back without the person that it needs")
        if not row.why:
            wrong.append("nothing says why it is not ready")
        for remedy in scenario.remedy:
            if not await rig.carry_out(remedy):
                wrong.append(f"`{remedy}` was not carried out")
            since_s = time.monotonic()
    if not await _until(_now(lambda: rig.wire.ready)):
        raise _Stuck(f"not ready again ({rig.wire.standing})" + ("" if row.why else ", and nothing says why"))
    row.recovered_s = round(max(0.0, time.monotonic() - since_s), 1)


def _as_expected(row: Row, scenario: Scenario, phase: Phase, wrong: list[str]) -> None:
    expected = scenario.of(phase)
    if row.outcome not in expected.outcomes:
        wrong.append(f"outcome {row.outcome} ({', '.join(row.reasons)}), expected {' or '.join(expected.outcomes)}")
    elif row.outcome != "PASS" and expected.reasons and not set(expected.reasons) & set(row.reasons):
        wrong.append(f"reasons {', '.join(row.reasons)}, expected {' or '.join(expected.reasons)}")


async def _next_fruit(rig: Rig, wrong: list[str]) -> None:
    before = len(rig.wire.passages)
    await rig.lay_and_trigger()
    if not await _until(_now(lambda: len(rig.wire.passages) > before)):
        raise _Stuck("the next fruit gets no outcome")
    after = rig.wire.passages[-1]
    if after.decision.value != "PASS":
        wrong.append(f"the next fruit, a good one, is {after.decision} ({', '.join(after.reasons)})")
    if not await _until(_now(lambda: rig.wire.ready)):
        wrong.append("not ready after the next fruit")


def disagreements(rig: Rig, accepted_before: int) -> list[str]:
    """Return the contradictions between the wire and the records, in words.

    Args:
        rig: the station.
        accepted_before: triggers that were accepted before those in question.
    """
    wrong, wire = list[str](), rig.wire
    if wire.doubled:
        wrong.append(f"{wire.doubled} results came again after their acknowledgement")
    accepted = wire.accepted[accepted_before:]
    for trigger_id in accepted:
        results = {
            number: shown for number, shown in wire.shown.items() if any(s.trigger_id == trigger_id for s in shown)
        }
        if len(results) != 1:
            wrong.append(f"trigger {trigger_id} has {len(results)} results: {sorted(results)}")
        for sequence, shown in results.items():
            if len(shown) != 1:
                wrong.append(f"result {sequence} changed while it was shown")
            wrong += _unlike_record(rig, sequence, next(iter(shown)))
    if unknown := {s.trigger_id for shown in wire.shown.values() for s in shown} - set(wire.accepted):
        wrong.append(f"results of triggers never accepted: {sorted(unknown)}")
    return wrong


def _unlike_record(rig: Rig, sequence: int, shown: Shown) -> list[str]:
    try:
        with reading(rig.records) as connection:
            record = read_inspection(connection, sequence, rig.records)
    except RecordsError as error:
        return [f"result {sequence} is not in the records: {error}"]
    standing = record.standing
    if standing is None:
        return [f"result {sequence} has no outcome in the records"]
    wrong = list[str]()
    if (standing.trigger_id, standing.outcome, tuple(sorted(standing.reasons))) != (
        shown.trigger_id, shown.outcome, shown.reasons
    ):  # fmt: skip
        wrong.append(f"result {sequence}: the PLC read {shown.outcome}, the records say {standing.outcome}")
    if record.acknowledged_utc_ms is None:
        wrong.append(f"result {sequence} is not acknowledged in the records")
    if shown.outcome == "PASS":
        judged = record.judged
        curve = () if judged is None else judged.curve
        reached_mm = max((point.closing_mm or 0.0 for point in curve), default=0.0)
        enough = reached_mm + AT_MM >= rig.recipe.damage.deciding_closing_mm
        whole = enough and all(point.area_mm2 is not None for point in curve)
        if judged is None or judged.outcome != "PASS" or judged.partial or not whole:
            wrong.append(f"result {sequence} is PASS without a whole curve that was judged so")
    return wrong


async def _poll_why(rig: Rig, row: Row) -> None:
    while True:
        why = await rig.why_not_ready()
        if why and not any(words in why for words in _PASSING):
            row.why = why
        await asyncio.sleep(_WHY_EVERY_S)


async def _sure(holds: Callable[[], bool], otherwise: Callable[[], str]) -> None:
    if not await _until(_now(holds)):
        raise _Stuck(otherwise())


def _now(holds: Callable[[], bool]) -> Callable[[], Awaitable[bool]]:
    async def evaluate() -> bool:
        return holds()

    return evaluate


async def _until(holds: Callable[[], Awaitable[bool]], limit_s: float = _PATIENCE_S) -> bool:
    ends_s = time.monotonic() + limit_s
    while not await holds():
        if time.monotonic() > ends_s:
            return False
        await asyncio.sleep(_LOOK_S)
    return True
