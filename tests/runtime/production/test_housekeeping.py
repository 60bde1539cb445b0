"""What is done beside the cycle, and when."""

import asyncio

import pytest

from station.inspection.states import State
from station.runtime.production import housekeeping

RETREAT = {State.RETREATING, State.RETREATING_READY, State.RETREATING_ACCEPTED}


@pytest.fixture
def seen(bench, monkeypatch):
    """Return the states in which freed memory was returned and damage looked for, while a line inspects two fruit."""
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
