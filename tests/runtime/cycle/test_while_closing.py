"""A press that is measured while the jaws close: one motion to the last limit, and nothing missed of what stops it."""

import asyncio
import json

import pytest

from station.inspection.states import State
from station.press import stop
from station.records.database import reading, records_folder
from station.vocabulary import Reason
from station.whatif.replay import recipe_of_snapshot, replay
from station.whatif.stored import read_stored, snapshots
from tests.stored_inspection import read_record


@pytest.fixture
def inspected(bench, settings_file, tmp_path):
    """A blueberry that is measured while the jaws close, perhaps with a low limit; its outcome and its record."""

    def run(limit_mm2=None):
        file, place = settings_file(), tmp_path / "recipes" / "blueberry.yaml"
        values = json.loads(file.read_text())
        values["gripper"]["move_margin_s"] = 10.0
        file.write_text(json.dumps(values))
        recipe = json.loads(place.read_text())
        recipe["steps"]["measured"] = "while_closing"
        recipe["press"]["attempts"] = 1  # only the first press is slow
        if limit_mm2 is not None:
            recipe["damage"]["area"][0] |= {"area_mm2": limit_mm2, "least_area_mm2": 0.0}
            recipe["damage"]["uncertainty"]["coverage"] = 0.5  # no guard band: what is over the limit is proven
            recipe["early_stop"]["area_mm2"] = limit_mm2
        place.write_text(json.dumps(recipe))

        async def scenario():
            async with bench(file) as cell:
                await cell.choose("blueberry")
                cell.lay("blueberry", 1)
                await cell.line.ready()
                boards = cell.twin.boards

                def slowly():
                    # A busy machine measures each frame before the next one, and before the fingers arrive.
                    boards["gripper"].set("slow", 30.0)
                    boards["camera"].set("slow", 5.0)
                    cell.at(State.SETTLING, at_its_speed)

                def at_its_speed():
                    # Fingers that are still slow would be given up while they release the fruit.
                    boards["gripper"].clear()
                    boards["camera"].clear()

                cell.at(State.MOVING, slowly)
                outcome = await cell.line.inspect()
                record = read_record(cell.station.service.registry.records, outcome.sequence)
                return outcome, record

        return asyncio.run(scenario())

    return run


@pytest.mark.timeout(180)
def test_a_fruit_is_decided_by_one_motion_and_its_images_say_the_same_again(inspected, tmp_path):
    outcome, record = inspected()
    judged = record.judged
    assert outcome.outcome == "PASS", judged.explanation
    closings_mm = [point.closing_mm for point in judged.curve]
    assert closings_mm == sorted(closings_mm)
    on_the_way = [each for each in closings_mm if 0 < each < 2.9]
    assert len(on_the_way) >= 2, "frames on the way, each with its width"
    assert 2.97 <= closings_mm[-1] < 3.4, "the last image is at rest where the limit is"
    with reading(records_folder(tmp_path / "home")) as connection:
        [stored] = read_stored(connection, [outcome.sequence], tmp_path, with_images=False)
        [own] = map(recipe_of_snapshot, snapshots(connection, "blueberry").values())
    assert own is not None
    assert own.steps.measured == "while_closing"
    again = replay(stored, own, own)
    assert (again.after, again.faithful) == ("PASS", True)


@pytest.mark.timeout(180)
def test_an_area_over_the_early_stop_ends_the_motion_on_its_way(inspected):
    outcome, record = inspected(limit_mm2=8.0)
    curve = record.judged.curve
    assert (outcome.outcome, outcome.reasons) == ("NO_RESULT", (Reason.EARLY_STOP,)), record.judged.explanation
    assert curve[-1].area_mm2 > 8.0
    assert curve[-1].closing_mm < 2.9, "it stopped before the limit's closing"


@pytest.mark.timeout(180)
def test_what_one_frame_on_the_way_says_is_asked_of_the_image_at_rest_and_else_the_steps_go_on(inspected, monkeypatch):
    stopped_at_mm, ends_steps = [], stop.ends_steps

    def once(press, recipe):
        closing_mm = press.points[-1].closing_mm
        if not stopped_at_mm and closing_mm > 1.0:
            stopped_at_mm.append(closing_mm)
            return True
        return ends_steps(press, recipe)

    monkeypatch.setattr(stop, "ends_steps", once)
    outcome, record = inspected()
    [ended_mm] = stopped_at_mm
    closings_mm = [point.closing_mm for point in record.judged.curve]
    assert outcome.outcome == "PASS", record.judged.explanation
    assert any(ended_mm < each < 2.9 for each in closings_mm), "at rest, where the motion was ended"
    assert 2.97 <= closings_mm[-1] < 3.4, "stepped on to the limit"
