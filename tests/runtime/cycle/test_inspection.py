"""One fruit, from the trigger to the outcome that the PLC gets, on a simulated bench."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from station.inspection.states import State
from station.twin.fruit import Kind, draw_fruit
from station.vocabulary import Reason
from tests.stored_inspection import read_record


@pytest.mark.parametrize(("kind", "seed"), [("strawberry", 3), ("raspberry", 4), ("blueberry", 1)])
def test_a_sound_fruit_is_measured_and_a_bruised_one_never_passes(bench, kind, seed):
    """The area at the last step is near what the gel truly felt: after the step that decides nothing is pressed on.

    The line sends no size here, and without one a small bruised strawberry has the area of a large sound one. These
    fruit are of a size at which bruised ones are far over the limit.
    """
    truths = {}

    async def scenario():
        async with bench() as cell:
            await cell.choose(kind)
            outcomes = []
            for bruised in (False, True):
                cell.lay(kind, seed, bruised=bruised)
                await cell.line.ready()
                cell.at(State.JUDGING, lambda bruised=bruised: truths.update({bruised: cell.twin.world.footprint()}))
                outcomes.append(await cell.line.inspect())
            service = cell.station.service
            return [(outcome, read_record(service.registry.records, outcome.sequence)) for outcome in outcomes]

    (sound, record), (bruised, _) = asyncio.run(scenario())
    judged = record.judged
    assert judged is not None
    assert sound.outcome == "PASS", judged.explanation
    deciding = min(judged.curve, key=lambda point: abs(point.closing_mm - sound.closing_mm))
    assert sound.area_mm2 == pytest.approx(deciding.area_mm2)
    assert [point.width_mm for point in judged.curve] == sorted((p.width_mm for p in judged.curve), reverse=True)
    assert judged.curve[-1].area_mm2 == pytest.approx(truths[False].true_area_px * 0.0266**2, rel=0.25)
    assert record.standing == sound
    assert bruised.outcome in {"FAIL", "NO_RESULT"}
    assert bruised.reasons


def test_what_cannot_be_measured_is_no_result(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            cell.twin.world.remove()
            empty = await cell.line.inspect()

            cell.lay("blueberry")
            assert (await cell.line.inspect()).outcome == "PASS", "the one before leaves nothing behind"
            touching = replace(draw_fruit(Kind.STRAWBERRY, 1), width_mm=56.0)
            cell.twin.world.place(touching)
            in_contact = await cell.line.inspect()
            record = read_record(cell.station.service.registry.records, in_contact.sequence)
            return empty, in_contact, record.judged.explanation

    empty, in_contact, explanation = asyncio.run(scenario())
    assert (empty.outcome, empty.reasons, empty.area_mm2) == ("NO_RESULT", (Reason.NO_CONTACT,), None)
    assert (in_contact.outcome, in_contact.reasons) == ("NO_RESULT", (Reason.REFERENCE_BAD,))
    assert "something touches the gel" in " ".join(map(str, explanation))


def test_a_fruit_wider_than_the_jaws_where_the_images_begin_is_no_result(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            await cell.choose("strawberry")
            fruit = replace(draw_fruit(Kind.STRAWBERRY, 3), width_mm=44.0)
            cell.twin.world.place(fruit)
            active = cell.station.service.active
            changes = {"start": "width", "start_width_mm": fruit.width_mm - 2}
            recipe = active.recipe.model_copy(update={"steps": active.recipe.steps.model_copy(update=changes)})
            cell.station.service.set_active(type(active).of(recipe))
            monkeypatch.setattr(cell.station.recipes, "current", lambda active: active)  # the lot begins with this one
            outcome = await cell.line.inspect()
            record = read_record(cell.station.service.registry.records, outcome.sequence)
            return outcome, record.judged

    outcome, judged = asyncio.run(scenario())
    assert outcome.outcome == "NO_RESULT"
    assert Reason.OUT_OF_RANGE in outcome.reasons
    assert "touched in the first image already" in " ".join(map(str, judged.explanation))
    assert judged.measures["onset_uncertainty_mm"] is None
    assert len(judged.curve) <= 2, "it is pressed on by the step that was under way, at most"


def test_an_early_stop_ends_the_closing_at_the_next_step_at_most(bench, monkeypatch):
    """The gripper never runs two steps ahead of the measurement."""

    async def scenario():
        async with bench() as cell:
            await cell.choose("raspberry")
            service = cell.station.service
            active = service.active
            stop = active.recipe.early_stop.model_copy(update={"area_mm2": 40.0})
            recipe = active.recipe.model_copy(update={"early_stop": stop})
            service.set_active(type(active).of(recipe))
            monkeypatch.setattr(cell.station.recipes, "current", lambda active: active)  # the lot begins with this one
            await cell.line.ready()
            outcome = await cell.line.inspect()
            record = read_record(service.registry.records, outcome.sequence)
            return outcome, record.judged.curve

    outcome, curve = asyncio.run(scenario())
    areas = np.array([point.area_mm2 for point in curve])
    assert Reason.EARLY_STOP in outcome.reasons
    assert areas[-1] > 40
    assert np.count_nonzero(areas > 40) <= 2
