"""What is done beside the cycle, and when."""

import asyncio

from station.inspection.states import State
from station.runtime.production import housekeeping


def test_freed_memory_is_returned_between_inspections_only(bench, monkeypatch):
    states = []
    monkeypatch.setattr(housekeeping, "_MEMORY_EVERY_S", 0.0)

    async def scenario():
        async with bench() as cell:
            monkeypatch.setattr(housekeeping, "return_freed_memory", lambda: states.append(cell.phase))
            await cell.choose("blueberry")
            cell.lay("blueberry")
            await cell.line.ready()
            await cell.until(lambda: states)
            await cell.line.inspect()
            before = len(states)
            await cell.until(lambda: len(states) > before)

    asyncio.run(scenario())
    assert set(states) == {State.IDLE}
