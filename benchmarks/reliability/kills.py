"""Random kills of the station's processes during whole inspections over the wire, some of them in a safety stop."""

import asyncio
import random
import time
from collections import Counter
from collections.abc import Callable, Sequence

from pydantic import BaseModel, ConfigDict

from .clock import CannotDoError
from .play import disagreements
from .rig import Rig
from .scenario import DeviceFault, ProcessFault

PROCESSES = ("service", "service", "plc", "hmi", "arm")
"""The service twice: it is what has the states."""
LONGEST_S = 6.0
"""A process is killed within this time after the trigger was accepted."""
_STOPS_ONE_IN = 4
_STAYS_S = 3.0
_PATIENCE_S = 120.0
_LOOK_S = 0.02
_STILL_RAD, _STILL_MM = 1e-3, 0.1
PERSONS = ("held", "aborted")
"""PackML states that may need a person."""


_HEAD = """# Kills during inspections

`./run bench kills --wire N` adds N kills to this page: the whole station with the simulated cell and a PLC on the wire.
In each inspection one process is killed (SIGKILL) within 6 s of the accepted trigger; in every fourth the arm stops
protectively before. Afterwards: one outcome for the trigger, the same in the records, and acknowledged; what only a
person may end is still held, nothing moves in it, and one reset leads on. The arm carries the fruit to its place in
every second station. `--seed S` repeats a station's kills. [Kills of the records alone](records-kills.md) have a page
of their own.
"""


class Kill(BaseModel):
    """One kill and what came of it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seed: int
    number: int
    """Of the kill, since the station with this seed was started."""
    process: str
    state: str
    """PackML's, as the PLC read it last before the kill."""
    outcome: str
    held: bool
    """A person was needed afterwards."""
    wrong: tuple[str, ...]


class _Stuck(Exception):  # noqa: N818 (no error of the program's)
    """The station does not come back."""


async def kill_once(rig: Rig, chance: random.Random, seed: int, number: int) -> Kill:
    """Inspect a fruit, kill a process meanwhile, and see that everything holds and the line goes on.

    Args:
        rig: ready for a trigger.
        chance: decides what is killed, and when.
        seed: of `chance`.
        number: of the kill.
    """
    wire, wrong = rig.wire, list[str]()
    process, after_s = chance.choice(PROCESSES), chance.uniform(0.0, LONGEST_S)
    stops, stops_s = chance.randrange(_STOPS_ONE_IN) == 0, chance.uniform(0.0, LONGEST_S / 2)
    accepted, passages = len(wire.accepted), len(wire.passages)
    state, held = "", False
    try:
        await _until(lambda: wire.ready, "not ready for the fruit")
        await rig.lay_and_trigger()
        await _until(lambda: len(wire.accepted) > accepted, "the trigger is not accepted")
        if stops:
            await asyncio.sleep(stops_s)
            await _protective_stop(rig)
            await _until(lambda: wire.packml == "aborted", "a safety stop is not shown")
        await asyncio.sleep(after_s)
        state = wire.packml
        needs_person = stops or (state == "held" and "fruit_held" in wire.alarms)
        await rig.begin(ProcessFault(process=process, signal="SIGKILL"))
        await _until(lambda: len(wire.passages) > passages, "the line gets no outcome")
        held = await _needs_person(rig)
        if needs_person and not held:
            wrong.append(f"{state} was forgotten")
        if held:
            wrong += await _moves(rig)
            await rig.twin(do="remove")
            if wire.packml == "aborted":
                await rig.carry_out("recover protective-stop")
            if not await rig.carry_out("reset"):
                wrong.append("the person's reset was not carried out")
        await _until(lambda: wire.ready, "not ready again")
    except (_Stuck, CannotDoError) as stuck:
        wrong.append(str(stuck))
    gone = len(wire.passages) - passages
    if gone != 1:
        wrong.append(f"{gone} outcomes for one fruit")
    wrong += disagreements(rig, accepted)
    outcome = wire.passages[-1].decision.value if gone else ""
    wire.forget_alarms()
    return Kill(
        seed=seed, number=number, process=process, state=state, outcome=outcome, held=held, wrong=tuple(wrong)
    )  # fmt: skip


async def _protective_stop(rig: Rig) -> None:
    """A stop that the arm's controller latches, whose cause is gone at once."""
    stop = DeviceFault(device="arm", fault="protective_stop")
    await rig.begin(stop)
    await rig.end(stop)


async def _needs_person(rig: Rig) -> bool:
    """Whether the station, once it answers again, comes to stand in a state that it does not leave by itself."""
    since_s, ends_s = None, time.monotonic() + _PATIENCE_S
    while time.monotonic() < ends_s:
        if rig.wire.ready:
            return False
        stands = rig.wire.packml in PERSONS and bool(rig.wire.alarms & {"fruit_held", "protective_stop"})
        since_s = (since_s or time.monotonic()) if stands else None
        if since_s is not None and time.monotonic() - since_s > _STAYS_S:
            return True
        await asyncio.sleep(_LOOK_S)
    raise _Stuck(f"neither ready nor held ({rig.wire.standing})")


async def _moves(rig: Rig) -> Sequence[str]:
    """What moves although only a person may lead on, by the twin's truth."""
    before = await rig.twin(do="state")
    await asyncio.sleep(1.0)
    after = await rig.twin(do="state")
    turned_rad = max(abs(a - b) for a, b in zip(before["arm_rad"], after["arm_rad"], strict=True))
    closed_mm = abs(before["width_mm"] - after["width_mm"])
    return (["the arm moves while held"] if turned_rad > _STILL_RAD else []) + (
        ["the jaws move while held"] if closed_mm > _STILL_MM else []
    )


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
    wrong = Counter(line for kill in kills for line in kill.wrong)
    states = sorted({kill.state for kill in kills})
    processes = sorted(set(PROCESSES))
    count = Counter((kill.state, kill.process) for kill in kills)
    seeds = Counter(kill.seed for kill in kills)
    held, bad = sum(kill.held for kill in kills), sum(bool(kill.wrong) for kill in kills)
    outcomes = sorted(Counter(kill.outcome or "none" for kill in kills).items())
    lines = [
        _HEAD,
        f"{len(kills)} kills, {held} of them with a state for a person, {bad} with something wrong.",
        "",
        f"| state that the PLC read | {' | '.join(processes)} |",
        f"| --- |{' --- |' * len(processes)}",
        *(f"| {state} | {' | '.join(str(count[state, process]) for process in processes)} |" for state in states),
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
