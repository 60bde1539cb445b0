"""The lot of a fruit whose outcome is the PLC interface's own, where a person named the lot at the panel."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

from station.channel.line import Outcome
from station.runtime.rpc.recent_inspections import RecentInspections
from station.runtime.rpc.restored_inspections import read_recent
from station.settings.recipe import find_recipe
from station.vocabulary import Reason

LOT = "A-17"


def lost(sequence: int) -> Outcome:
    """Return the interface's NO_RESULT for a trigger whose lot the PLC has not named."""
    return Outcome(
        sequence=sequence, trigger_id=7, outcome="NO_RESULT", reasons=(Reason.STATION_LOST,), late=False, partial=True,
        simulated=True, area_mm2=None, area_px=None, closing_mm=None, confidence=None, recipe_number=1,
        recipe_checksum=0, began_utc_ms=1_700_000_000_000, ended_utc_ms=1_700_000_003_000, duration_ms=3000,
        encoder=1234, lot="",
    )  # fmt: skip


def test_it_is_the_triggers_also_after_a_start(opened, scenario, trigger, passed, folder):
    record = replace(passed, curve=())

    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            await records.published(lost(sequence))
            return await records.conclude(sequence, record, trigger)

    standing = scenario(steps)
    assert (standing.outcome, standing.lot, trigger.lot) == ("NO_RESULT", "", LOT)
    now: Any = SimpleNamespace(
        standing=standing, published=None, trigger=trigger, record=lambda: record, seen=[],
        limits=SimpleNamespace(inspection_s=15.0),
        active=SimpleNamespace(recipe=find_recipe("strawberry"), snapshot=trigger.recipe),
    )  # fmt: skip

    async def seen():
        recent, again = RecentInspections(lambda _lot, _below: {}), RecentInspections(lambda _lot, _below: {})
        recent.add(now)
        again.restore(*read_recent(folder, lambda _recipe: 15.0))
        for known in (recent, again):
            assert known.counts(LOT).unjudged == 1
            assert known.counts("").unjudged == 0
            assert [each.lot for each in known.recent(9)] == [LOT]
            assert known.fruit(standing.sequence).short.lot == LOT
            await known.close()

    scenario(seen)
