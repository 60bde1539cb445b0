"""The fruit's size over the real wire: what the PLC wrote reaches record and result, and one that cannot be decides."""

import asyncio
import json

import pytest

from station.inspection.fruit_size import FruitSize
from station.settings.recipe import load_recipes
from tests.stored_inspection import read_record

NOT_GIVEN = FruitSize()


@pytest.mark.timeout(180)
def test_wrong_and_stale_sizes_are_recorded_and_echoed_as_they_were_given(
    bench, plc_interface, settings_file, tmp_path
):
    given = {
        "absent": ({}, NOT_GIVEN),
        "length and class": ({"fruit_length_mm_x10": 161, "size_class": 3}, FruitSize(16.1, 3)),
        "stale": ({}, NOT_GIVEN),
        "impossible": ({"fruit_length_mm_x10": 65_535, "size_class": 65_535}, FruitSize(6553.5, 65_535)),
        "contradiction": ({"fruit_length_mm_x10": 161, "size_class": 1}, FruitSize(16.1, 1)),
        "0": ({"fruit_length_mm_x10": 0, "size_class": 0}, NOT_GIVEN),
    }

    async def scenario():
        async with bench(file) as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            cell.lay("blueberry")
            async with plc_interface(tmp_path / "station.yaml") as plc:
                found = {}
                for trigger_id, (name, (size, _)) in enumerate(given.items(), start=1):
                    found[name] = await inspected(cell, plc, trigger_id, size)
                return found

    async def inspected(cell, plc, trigger_id, size):
        while "trigger_ready" not in await plc.status():
            await asyncio.sleep(0.02)
        if size:
            await plc.write(size)
        await plc.write({"control": 1 | 2, "trigger_id": trigger_id})
        while (shown := await plc.pending_result()) is None:
            await asyncio.sleep(0.02)
        await plc.write({"control": 1})
        assert shown.trigger_id == trigger_id
        record = read_record(cell.station.service.registry.records, shown.sequence)
        outcomes[trigger_id] = (shown.outcome, tuple(shown.reasons))
        await plc.acknowledge(shown.sequence)
        return record.trigger.size, FruitSize(shown.fruit_length_mm, shown.size_class)

    file, place = settings_file(), tmp_path / "recipes" / "blueberry.yaml"
    recipe = json.loads(place.read_text())
    recipe["damage"]["size"] = load_recipes()["blueberry"].model_dump(mode="json")["damage"]["size"]
    place.write_text(json.dumps(recipe))
    outcomes = {}
    assert asyncio.run(scenario()) == {name: (size, size) for name, (_, size) in given.items()}
    by_name = dict(zip(given, outcomes.values(), strict=True))
    assert by_name["impossible"] == by_name["contradiction"] == ("NO_RESULT", ("size_unknown",))
    assert {by_name[name] for name in ("absent", "length and class", "stale", "0")} == {("PASS", ())}, (
        "by the fallback too"
    )
