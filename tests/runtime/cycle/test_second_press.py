"""A second press over the twin's wire: an inconclusive fruit is pressed once more, and judged by both presses."""

import asyncio

import pytest

from station.inspection.states import State
from station.messages.judge import CUT_BY_BORDER
from station.records.database import reading, records_folder
from station.records.report import format_inspection
from station.vocabulary import Reason
from station.whatif.replay import recipe_of_snapshot, replay
from station.whatif.stored import read_stored, snapshots
from tests.stored_inspection import read_record

FRUIT, OFF_MM = 16, 3.0
"""At its place, the border cuts it in every press; in the middle, in none, however long the flesh creeps."""


@pytest.fixture
def inspected(bench, roomy):
    """A strawberry laid off the middle; what is done while the jaws open again; its outcome and record."""

    def run(meanwhile):
        async def scenario():
            async with bench(roomy()) as cell:
                await cell.choose("strawberry")
                cell.lay("strawberry", FRUIT, x_mm=OFF_MM)
                await cell.line.ready()
                openings = []
                cell.at(State.OPENING_AGAIN, lambda: (openings.append(cell.phase), meanwhile(cell)))
                outcome = await cell.line.inspect()
                record = read_record(cell.station.service.registry.records, outcome.sequence)
                return outcome, record, openings

        return asyncio.run(scenario())

    return run


@pytest.mark.timeout(180)
def test_a_fruit_that_the_border_cut_at_the_first_press_passes_with_the_second(inspected, tmp_path):
    outcome, record, openings = inspected(lambda cell: cell.lay("strawberry", FRUIT))
    judged = record.judged
    assert openings == [State.OPENING_AGAIN], judged.explanation
    assert outcome.outcome == "PASS", judged.explanation
    assert judged.measures["presses"] == 2
    assert judged.first_press_findings.id == CUT_BY_BORDER.id
    assert not any("cut_by_border" in point.flags for point in judged.curve)
    assert judged.phases_s["opening_again"] > 0
    shown = format_inspection(record)
    assert "Pressed twice, since the first press did not decide: At " in shown
    assert "first_press" not in shown
    with reading(records_folder(tmp_path / "home")) as connection:
        [stored] = read_stored(connection, [outcome.sequence], tmp_path, with_images=False)
        [own] = map(recipe_of_snapshot, snapshots(connection, "strawberry").values())
    assert own is not None
    assert stored.first is not None
    assert any("cut_by_border" in point.flags for point in stored.first.points)
    again = replay(stored, own, own)
    assert (again.after, again.faithful) == ("PASS", True)
    once = own.model_copy(update={"press": own.press.model_copy(update={"attempts": 1})})
    assert replay(stored, own, once).after == "NO_RESULT", "the first press alone"


@pytest.mark.timeout(180)
def test_a_fruit_is_pressed_twice_at_most_and_a_fault_on_the_way_is_the_reason(inspected):
    outcome, record, openings = inspected(lambda _cell: None)
    assert (outcome.outcome, record.judged.measures["presses"]) == ("NO_RESULT", 2)
    assert Reason.CUT_BY_BORDER in outcome.reasons
    assert len(openings) == 1

    outcome, record, _ = inspected(lambda cell: cell.twin.world.remove())
    assert (outcome.outcome, outcome.reasons) == ("NO_RESULT", (Reason.NO_CONTACT,))
