"""The counts of a lot on the page Run are the records', also after other fruit since its last one."""

import asyncio
import threading
from collections import Counter
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.client import ChannelClient
from station.channel.line import Begin, BeginReply
from station.channel.panel_run import FruitSummary, GetPanelState, PanelState
from station.messages import records as messages
from station.records.database import plain, reading
from station.records.errors import RecordsError
from station.records.model import InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.runtime.rpc import recent_inspections, restored_inspections
from station.runtime.rpc.recent_inspections import MOST_IN_FULL, RecentInspections
from station.settings.hmi import panel_endpoint
from station.settings.recipe import find_recipe
from station.settings.records import RecordsSettings

PASSED = FruitSummary(
    sequence=1, outcome="PASS", reasons=(), ended_utc_ms=1, duration_ms=1900, recipe="strawberry", lot="",
    area_mm2=60.0, closing_mm=3.0, areas_mm2=(),
)  # fmt: skip


async def store(folder, lots):
    """Store one rejected fruit of each lot, as delivered by an earlier start of the station."""
    records = await Records.open(folder, RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "before")
    recipe = RecipeSnapshot.of(find_recipe("strawberry").model_dump(mode="json"))
    judged = InspectionRecord(
        "FAIL", ("area_over_limit",), (), False, False, 170.0, 44_500, 4.0, 0.9, 1_700_000_003_210, 3210
    )
    try:
        for number, lot in enumerate(lots, 1):
            sequence = await records.begin(Trigger(number, 1234, lot, 1_700_000_000_000, recipe, True))
            await records.published(await records.conclude(sequence, judged))
            await records.acknowledged(sequence)
    finally:
        await records.close()


@pytest.mark.timeout(240)
def test_a_lot_that_returns_after_a_start_is_counted_with_all_its_fruit(bench, settings_file, tmp_path, monkeypatch):
    monkeypatch.setattr(restored_inspections, "MOST_IN_SHORT", 5)
    file, folder = settings_file(), tmp_path / "home" / "records"

    async def scenario():
        await store(folder, ["X", "X", *6 * ["Y"]])
        async with bench(file) as cell:
            configuration = cell.configuration
            await cell.choose("blueberry")
            await cell.line.ready()
            reply = await cell.line.client.request(Begin(trigger_id=900, encoder=7, lot="X"), BeginReply, deadline_s=20)
            assert reply.refusal is None
            await cell.line.publish(await cell.line.outcome(reply.sequence))
            async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:

                async def counted():
                    counts = (await panel.request(GetPanelState(), PanelState, deadline_s=20)).lot_counts
                    return counts if counts.passed + counts.failed + counts.unjudged >= 3 else None

                await cell.until(counted)
                return await counted()

    counts = asyncio.run(scenario())
    assert counts is not None
    with reading(folder) as connection:
        query = "SELECT outcome, count(*) FROM inspections WHERE lot = 'X' GROUP BY outcome"
        stored = dict(plain(connection).execute(query).fetchall())
    assert sum(stored.values()) == 3
    assert Counter(PASS=counts.passed, FAIL=counts.failed, NO_RESULT=counts.unjudged) == Counter(stored)


def test_a_lot_in_use_stays_in_memory_and_one_that_left_it_is_read_again_while_its_fruit_are_counted(monkeypatch):
    monkeypatch.setattr(recent_inspections, "_new_fruit", lambda _, short: (SimpleNamespace(short=short), None))
    monkeypatch.setattr(recent_inspections, "_RETRY_S", 0.01)
    stored, read, failures, may_read = list[FruitSummary](), list[str](), list[RecordsError](), threading.Event()

    def read_counts(lot: str, below: int) -> Counter[str]:
        read.append(lot)
        assert may_read.wait(60)
        if failures:
            raise failures.pop()
        return Counter[str](each.outcome for each in stored if each.lot == lot and each.sequence < below)

    async def scenario():
        inspections = RecentInspections(read_counts)

        def inspect(lot):
            stored.append(PASSED.model_copy(update={"sequence": len(stored) + 1, "lot": lot}))
            now: Any = SimpleNamespace(standing=stored[-1], published=None)
            inspections.add(now)

        async def all_read():
            async with asyncio.timeout(60):
                while inspections._reading:
                    await asyncio.sleep(0.01)

        may_read.set()
        for number in range(MOST_IN_FULL + 6):
            inspect("in use")
            inspect(f"lot {number}")
            await all_read()
        assert inspections.counts("in use").passed == MOST_IN_FULL + 6
        assert read.count("in use") == 1

        may_read.clear()
        failures.append(RecordsError(messages.RECORDS_EMPTY(), messages.BEGIN_FIRST()))
        assert inspections.counts("lot 0").passed == 0, "nothing waits for the disk"
        inspect("lot 0")
        assert inspections.counts("lot 0").passed == 1
        may_read.set()
        await all_read()
        assert inspections.counts("lot 0").passed == 2
        assert read.count("lot 0") == 3, "at its first fruit, and twice again as the first try failed"

        may_read.clear()
        inspections.counts("lot 1")
        await asyncio.sleep(0)
        await inspections.close()
        may_read.set()
        assert inspections._reading == set()

    asyncio.run(scenario())
