"""Judgements of drawn presses stay what they were, to every number and sentence; and limits that are met exactly."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest

from station.inspection.evidence import AT_MM, Evidence
from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.inspection.sized_limits import sized_limits
from station.messages import judge as messages
from station.settings.recipe_model import Recipe
from station.vocabulary import Flag, Reason
from tests.inspection.played_presses import PRESSES, judged, recipes

GOLDEN = Path(__file__).parent / "golden" / "judgements.json"
"""`python -m tests.inspection.test_evidence` writes it anew: then look at each difference."""
RECIPES = list(recipes())


def judgements() -> list[object]:
    """Each press by one of the recipes in turn."""
    return [judged(number, RECIPES[number % len(RECIPES)]) for number in range(PRESSES)]


@pytest.mark.parametrize("part", range(4))
def test_a_press_is_judged_as_it_was(part):
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    for number in range(part * PRESSES // 4, (part + 1) * PRESSES // 4):
        assert judged(number, RECIPES[number % len(RECIPES)]) == golden[number], f"press {number}"


def test_presses_of_every_outcome_and_of_most_reasons_are_among_them():
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert {each["outcome"] for each in golden} == {"PASS", "FAIL", "NO_RESULT"}
    assert len({finding[0] for each in golden for finding in each["findings"]}) > 10
    assert any(each["stops"] for each in golden)
    assert any(each["again"] for each in golden)
    assert len({json.dumps(each) for each in golden}) > 0.8 * PRESSES


def even(growth: float, onset_mm: float = 35.0) -> Press:
    """A fruit whose area grows evenly, measured without doubt."""
    return Press(onset_mm, 0.4, tuple(Measured(float(c), growth * c, 1000 * c, 0.9) for c in range(9)))


def with_limit(recipe: Recipe, **changes: float) -> Recipe:
    """The recipe with another limit at its first threshold."""
    first, *others = recipe.damage.area
    area = (first.model_copy(update=changes), *others)
    return recipe.model_copy(update={"damage": recipe.damage.model_copy(update={"area": area})})


def reasons(press: Press, recipe: Recipe) -> set[Reason]:
    return set(judge(press, recipe).reasons)


def test_limits_that_are_met_exactly_are_kept():
    recipe, soft = RECIPES[0], even(16.0)
    evidence = Evidence(soft, sized_limits(soft, recipe))
    area, uncertainty = evidence.area_at(3.0) or (0.0, 0.0)
    least = evidence.least_area_mm2(3.0) or 0.0
    assert reasons(soft, with_limit(recipe, area_mm2=area + uncertainty)) == set()
    assert reasons(soft, with_limit(recipe, area_mm2=math.nextafter(area + uncertainty, 0))) == {Reason.NEAR_LIMIT}
    assert reasons(soft, with_limit(recipe, area_mm2=least)) == {Reason.NEAR_LIMIT}
    assert Reason.AREA_OVER_LIMIT in reasons(soft, with_limit(recipe, area_mm2=math.nextafter(least, 0)))
    assert reasons(soft, with_limit(recipe, least_area_mm2=area - uncertainty)) == set()
    too_small = math.nextafter(area - uncertainty, 100)
    assert reasons(soft, with_limit(recipe, least_area_mm2=too_small)) == {Reason.LOW_CONFIDENCE}


def with_growth_limit(recipe: Recipe, limit: float) -> Recipe:
    return recipe.model_copy(update={"damage": recipe.damage.model_copy(update={"growth_mm2_per_mm": limit})})


def test_growth_limits_that_are_met_exactly_are_kept():
    recipe, soft = RECIPES[0], even(16.0)
    growths = Evidence(soft, sized_limits(soft, recipe)).growths
    most = max(growth.most_mm2_per_mm for growth in growths)
    least = max(growth.least_mm2_per_mm for growth in growths)
    assert reasons(soft, with_growth_limit(recipe, most)) == set()
    assert reasons(soft, with_growth_limit(recipe, math.nextafter(most, 0))) == {Reason.NEAR_LIMIT}
    assert reasons(soft, with_growth_limit(recipe, least)) == {Reason.NEAR_LIMIT}
    assert reasons(soft, with_growth_limit(recipe, math.nextafter(least, 0))) == {Reason.GROWTH_OVER_LIMIT}


def test_a_doubtful_step_is_excused_up_to_the_last_limit_itself():
    recipe, soft = RECIPES[0], even(16.0)
    *earlier, last = recipe.damage.area
    area, uncertainty = Evidence(soft, sized_limits(soft, recipe)).area_at(last.closing_mm) or (0.0, 0.0)
    points = tuple(replace(each, confidence=0.1) if each.closing_mm == 2.0 else each for each in soft.points)
    for limit, found in (
        (area + uncertainty, set()),
        (math.nextafter(area + uncertainty, 0), {Reason.NEAR_LIMIT, Reason.LOW_CONFIDENCE}),
    ):
        area_limits = (*earlier, last.model_copy(update={"area_mm2": limit}))
        damage = recipe.damage.model_copy(update={"area": area_limits})
        assert reasons(replace(soft, points=points), recipe.model_copy(update={"damage": damage})) == found


def test_a_step_as_far_before_a_threshold_as_may_be_is_at_it():
    before = Press(35.0, 0.4, (Measured(0.0, 5.0, 1000, 0.9),))
    recipe = with_limit(RECIPES[0], closing_mm=AT_MM)
    assert Evidence(before, sized_limits(before, recipe)).reached_mm == AT_MM


def test_the_growth_over_light_touches_is_as_uncertain_as_repeating_makes_them():
    recipe, touches = RECIPES[0], Press(35.0, 0.4, tuple(Measured(c / 4, 4.0 * c, 1000 * c, 0.9) for c in range(1, 5)))
    uncertainty = recipe.damage.uncertainty
    doubled = tuple(each.model_copy(update={"relative": 2 * each.relative}) for each in uncertainty.repeatability)
    damage = recipe.damage.model_copy(update={"uncertainty": uncertainty.model_copy(update={"repeatability": doubled})})
    once = Evidence(touches, sized_limits(touches, recipe)).latest_growth
    twice = Evidence(touches, sized_limits(touches, recipe.model_copy(update={"damage": damage}))).latest_growth
    assert once is not None
    assert twice is not None
    assert twice.uncertainty_mm2_per_mm > once.uncertainty_mm2_per_mm


def test_a_press_without_a_step_has_reached_nothing():
    verdict = judge(Press(35.0, 0.4, ()), RECIPES[0])
    first_mm = RECIPES[0].damage.area[0].closing_mm
    assert [each.message for each in verdict.findings] == [messages.STEPS_ENDED(reached_mm=0.0, wanted_mm=first_mm)]
    assert verdict.partial


def test_the_smallest_and_the_largest_fruit_are_the_recipes():
    recipe = RECIPES[0]
    width = recipe.expected_width
    for onset_mm in (width.smallest_mm, width.largest_mm):
        assert judge(even(16.0, onset_mm), recipe).outcome == "PASS"
    for onset_mm in (math.nextafter(width.smallest_mm, 0), math.nextafter(width.largest_mm, 100)):
        assert reasons(even(16.0, onset_mm), recipe) == {Reason.OUT_OF_RANGE}


def test_early_stops_limits_may_be_reached_and_not_passed():
    recipe, stop = RECIPES[0], RECIPES[0].early_stop
    steps = even(16.0)
    evidence = Evidence(steps, sized_limits(steps, recipe))
    assert evidence.latest_growth is not None
    growth = evidence.latest_growth.mm2_per_mm
    for changes, stops in (
        ({"area_mm2": 128.0}, False),
        ({"area_mm2": math.nextafter(128.0, 0)}, True),
        ({"growth_mm2_per_mm": growth}, False),
        ({"growth_mm2_per_mm": math.nextafter(growth, 0)}, True),
    ):
        limited = recipe.model_copy(update={"early_stop": stop.model_copy(update=changes)})
        assert (early_stop(steps, limited) is not None) == stops, changes


def test_half_steps_make_a_window_of_two_millimetres():
    half = Press(35.0, 0.4, tuple(Measured(3 + c / 2, 16.0 * (3 + c / 2), 1000 * c, 0.9) for c in range(5)))
    short, growth = Evidence(half, sized_limits(half, RECIPES[0])).growths
    assert (short.from_closing_mm, short.to_closing_mm, short.few) == (3.0, 4.5, True)
    assert (growth.from_closing_mm, growth.to_closing_mm, growth.few) == (3.0, 5.0, False)
    uneven = Press(35.0, 0.4, tuple(Measured(c, 16.0 * c, 1000, 0.9) for c in (2.0, 3.0, 4.0, 4.5, 5.0)))
    latest = Evidence(uneven, sized_limits(uneven, RECIPES[0])).latest_growth
    assert latest is not None
    assert latest.from_closing_mm == 3.0


def test_steps_that_share_a_closing_have_the_doubts_of_each():
    pair = (Measured(3.0, 50.0, 1000, 0.9), Measured(3.0, 40.0, 800, 0.9, frozenset({Flag.SATURATED})))
    (point,) = Evidence(Press(35.0, 0.4, pair), sized_limits(even(16.0), RECIPES[0])).points
    assert (point.area_mm2, point.area_scatter_mm2, point.flags) == (50.0, 10.0, {Flag.SATURATED})


def test_a_press_of_which_only_the_end_was_measured_is_no_result():
    late = Press(35.0, 0.4, even(16.0).points[7:])
    assert early_stop(late, RECIPES[0]) is None
    assert judge(late, RECIPES[0]).outcome == "NO_RESULT"


def test_of_three_limits_the_last_decides_where_none_is_trusted():
    recipe = next(each for each in RECIPES if each.damage.decided_by == "first_trusted")
    third = recipe.damage.area[-1].model_copy(update={"closing_mm": 8.0, "area_mm2": 160.0})
    damage = recipe.damage.model_copy(update={"area": (*recipe.damage.area, third)})
    doubtful = replace(even(16.0), points=tuple(replace(each, confidence=0.1) for each in even(16.0).points))
    summary = judge(doubtful, recipe.model_copy(update={"damage": damage})).summary
    assert summary is not None
    assert "at 8 mm" in str(summary)


SENTENCES = {
    Reason.REFERENCE_BAD: messages.REFERENCE_BAD,
    Reason.IMAGE_STALE: messages.IMAGE_STALE,
    Reason.LATE: messages.LATE,
    Reason.CALLED_OFF: messages.CALLED_OFF,
    Reason.ARM_FAULT: messages.ARM_FAULT,
    Reason.GRIPPER_FAULT: messages.GRIPPER_FAULT,
    Reason.CAMERA_FAULT: messages.CAMERA_FAULT,
    Reason.RECORDS_FAULT: messages.RECORDS_FAULT,
    Reason.STATION_LOST: messages.STATION_LOST,
    Reason.INTERNAL_FAULT: messages.INTERNAL_FAULT,
    Reason.NO_CONTACT: messages.NOTHING_TOUCHED,
}


@pytest.mark.parametrize("reason", Reason)
def test_an_interruption_has_a_sentence_of_its_own_or_names_its_reason(reason):
    verdict = judge(replace(even(16.0), interruptions=(reason,)), RECIPES[0])
    (finding,) = verdict.findings
    assert (verdict.outcome, finding.reason) == ("NO_RESULT", reason)
    assert finding.message.id == SENTENCES.get(reason, messages.INTERRUPTED).id


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    rows = ",\n".join(json.dumps(each, ensure_ascii=False) for each in judgements())
    GOLDEN.write_text(f"[\n{rows}\n]\n", encoding="utf-8")
