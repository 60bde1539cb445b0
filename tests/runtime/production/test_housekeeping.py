"""Housekeeping beside the cycle: done between inspections; a slow recovery and steps of the clock are handled."""

import asyncio
import time
from types import SimpleNamespace
from typing import Any

import pytest

from station.inspection.alarm_table import AlarmId
from station.inspection.states import State
from station.messages.message import Message
from station.messages.operation import CLOCK_BACK, CLOCK_FORWARD
from station.runtime.devices.manager import GRIPPER
from station.runtime.observability.health import Liveness
from station.runtime.production import housekeeping
from station.runtime.production.housekeeping import HOUSEKEEPING, Housekeeping
from station.settings.configuration import Configuration

RETREAT = {State.RETREATING, State.RETREATING_READY, State.RETREATING_ACCEPTED}


@pytest.fixture
def seen(bench, monkeypatch):
    """Return the states in which freed memory was returned and damage searched for, while a line inspects two fruit."""
    returned, searched = [], []
    # Always due: what is left out by the phase is all that is left out.
    for period, length_s in {"_MEMORY_EVERY_S": 0.0, "_DAMAGE_EVERY_S": 0.0, "PERIOD_S": 0.02}.items():
        monkeypatch.setattr(housekeeping, period, length_s)

    async def scenario():
        async with bench() as cell:
            find_damage = cell.station.service.registry.records.find_damage

            async def find():
                searched.append(cell.phase)
                await find_damage()

            monkeypatch.setattr(cell.station.service.registry.records, "find_damage", find)
            monkeypatch.setattr(housekeeping, "return_freed_memory", lambda: returned.append(cell.phase))
            await cell.choose("blueberry")
            for _ in range(2):
                await cell.line.inspect()
            await cell.reach(State.IDLE)

    asyncio.run(scenario())
    return returned, searched


def test_freed_memory_and_damage_are_seen_to_between_inspections_also_at_full_pace(seen):
    for states in map(set, seen):
        assert states <= {State.IDLE, *RETREAT}
        assert states & RETREAT, "a line at full pace leaves no idle station"


class SlowRecords:
    """Records with a fault, whose opening begins and does not end."""

    def __init__(self) -> None:
        self.fault, self.records, self.opening = True, SimpleNamespace(notices=()), asyncio.Event()

    async def reopen(self, **_: object) -> None:
        self.opening.set()
        await asyncio.Event().wait()


def housekeeping_of(records: SlowRecords, liveness: Liveness, on_round: Any, home: Any) -> Housekeeping:
    """Make the housekeeping of a held station without any other fault; it calls a function at each round's end."""
    service = SimpleNamespace(state=State.HELD, makes_itself_ready=False, registry=records)
    gripper = SimpleNamespace(fault=None)
    devices = SimpleNamespace(monitors={GRIPPER: gripper}, faults={}, needs_program_restart=False)
    nothing: Any = None
    production: Any = SimpleNamespace(
        service=service, devices=devices, line_state=nothing, recipes=nothing,
        interlock=SimpleNamespace(refusal=lambda: (None, None)),
    )  # fmt: skip
    seen: Any = SimpleNamespace(metrics=SimpleNamespace(ready=on_round), liveness=liveness, audit=nothing)
    return Housekeeping(Configuration(home=home), production, seen, {}, None)


@pytest.mark.parametrize("longest_s", [None, 0.0])
def test_a_slow_recovery_is_progress_until_its_own_limit(tmp_path, monkeypatch, longest_s):
    """Without it the PLC's heartbeat and the arm's program would stop, and the process be ended."""
    monkeypatch.setattr(housekeeping, "PERIOD_S", 0.01)
    for period in ("_ALARMS_EVERY_S", "_RECIPES_EVERY_S"):
        monkeypatch.setattr(housekeeping, period, float("inf"))
    if longest_s is not None:
        monkeypatch.setattr(housekeeping, "_LONGEST_RECOVERY_S", longest_s)
    now_s, progress_s = 0.0, Configuration(home=tmp_path).service.progress_s

    async def main():
        nonlocal now_s
        liveness, records, rounds = Liveness(lambda: now_s), SlowRecords(), asyncio.Semaphore(0)
        liveness.watch(HOUSEKEEPING, progress_s)
        housekeeping = housekeeping_of(records, liveness, lambda **_: rounds.release(), tmp_path)
        running = asyncio.create_task(housekeeping.run())
        async with asyncio.timeout(30):
            await records.opening.wait()
            for _ in range(4):
                now_s += 0.75 * progress_s
                for _ in range(2):  # the round that was under way, and a whole one
                    await rounds.acquire()
        assert set(liveness.stuck()) == (set() if longest_s is None else {HOUSEKEEPING})
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        assert len(asyncio.all_tasks()) == 1, "the recovery has ended too"

    asyncio.run(main())


@pytest.mark.parametrize(("step_s", "detail"), [(3600.0, CLOCK_FORWARD), (-3600.0, CLOCK_BACK), (1.0, None)])
def test_a_step_of_the_clock_is_an_alarm_once(monkeypatch, step_s, detail):
    raised: dict[AlarmId, Message] = {}
    alarms = SimpleNamespace(raise_=raised.__setitem__, clear=lambda alarm: raised.pop(alarm, None))
    service: Any = SimpleNamespace(alarms=alarms)
    keeping = Housekeeping.__new__(Housekeeping)
    keeping._service = service
    keeping._clock_offset_s = time.time() - time.monotonic()
    utc_s = time.time
    monkeypatch.setattr(housekeeping.time, "time", lambda: utc_s() + step_s)
    keeping._check_clock()
    assert {alarm: message.id for alarm, message in raised.items()} == (
        {AlarmId.CLOCK_STEPPED: detail.id} if detail else {}
    )
    keeping._check_clock()
    assert raised == {}
