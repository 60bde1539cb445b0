"""The judge: what passes, what is proven damaged, and what is neither."""

import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.evidence import Evidence
from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.inspection.sized_limits import sized_limits
from station.messages import judge as messages
from station.messages.message import SENTENCES
from station.settings.recipe import load_recipe
from station.settings.recipe_model import Recipe
from station.vocabulary import Flag, Reason

ROOT = Path(__file__).resolve().parents[2]


def recipe_with(name: str, areas: dict[float, float], growth: float, stop: tuple[float, float]) -> Recipe:
    """A shipped recipe with limits of its own: these tests are about the judge, not about what is shipped."""
    values = load_recipe(ROOT / "recipes" / f"{name}.yaml").model_dump(mode="json")
    values["damage"] = {
        "area": [{"closing_mm": closing, "area_mm2": area} for closing, area in areas.items()],
        "growth_mm2_per_mm": growth,
        "uncertainty": {"coverage": 0.95, "repeatability": [{"closing_mm": 3, "relative": 0.03}]},
    }
    values["steps"]["stop_when_decided"] = False
    values["early_stop"] = {"area_mm2": stop[0], "growth_mm2_per_mm": stop[1]}
    values["steps"]["result_closings_mm"] = [
        closing for closing in values["steps"]["result_closings_mm"] if closing > 3
    ]
    return Recipe.model_validate_json(json.dumps(values))


STRAWBERRY = recipe_with("strawberry", {4: 165}, 41, (190, 55))
BLUEBERRY = recipe_with("blueberry", {8: 149, 12: 190}, 18.6, (190, 24.8))


def point(closing_mm: float, area_mm2: float, *flags: Flag, confidence: float | None = 0.9) -> Measured:
    """A step as a sound image gives it."""
    px = round(area_mm2 / 0.0266**2)
    return Measured(closing_mm, area_mm2, px, confidence, frozenset(flags))


def pressed(growth: float, to_mm: int = 12, **changes: Any) -> Press:
    """A strawberry whose area grows evenly, until the early stop ends it."""
    points: list[Measured] = []
    for closing in range(to_mm + 1):
        points.append(point(float(closing), min(217.0, 2 + growth * closing)))
        if early_stop(Press(35.0, 1.0, tuple(points)), STRAWBERRY):
            break
    return replace(Press(35.0, 1.0, tuple(points)), **changes)


def spoilt(press: Press, closing_mm: float, *flags: Flag, **changes: Any) -> Press:
    """The press with one of its points changed."""
    return replace(
        press,
        points=tuple(
            replace(p, flags=p.flags | set(flags), **changes) if p.closing_mm == closing_mm else p for p in press.points
        ),
    )


def test_a_sound_fruit_passes_with_its_areas_and_growth():
    verdict = judge(pressed(15), STRAWBERRY)
    assert (verdict.outcome, verdict.reasons, verdict.partial, verdict.stopped) == ("PASS", (), False, None)
    assert [(area.closing_mm, area.area_mm2, area.limit_mm2) for area in verdict.areas] == [
        (4, pytest.approx(62), 165), (8, pytest.approx(122), None), (12, pytest.approx(182), None)
    ]  # fmt: skip
    assert verdict.growth
    assert verdict.growth.mm2_per_mm == pytest.approx(15)
    assert verdict.deciding
    assert verdict.deciding.closing_mm == 4


def test_a_full_field_after_the_last_threshold_spares_a_sound_fruit_and_passes_it():
    verdict = judge(pressed(27), STRAWBERRY)
    assert verdict.outcome == "PASS"
    assert verdict.partial
    assert verdict.stopped
    assert verdict.stopped.message == messages.STOPPED_AREA(closing_mm=7.0, area_mm2=191.0, limit_mm2=190.0)
    assert verdict.areas[-1].area_mm2 is None


def test_two_images_of_one_count_of_the_gripper_prove_no_growth():
    values = BLUEBERRY.model_dump(mode="json")
    values["damage"]["uncertainty"]["coverage"] = 0.6  # hardly a guard band
    recipe = Recipe.model_validate_json(json.dumps(values))
    press = Press(16.0, 0.4, (point(4.20, 42.0), point(4.24, 46.0)), resolution_mm=0.374)
    assert judge(press, recipe).growth is None
    for apart_mm, resolution_mm in ((0.15, 0.374), (0.25, 0.5)):  # less than half a count, and half of it
        points = (point(4.5, 42.0), point(4.5 + apart_mm, 46.0))
        assert judge(replace(press, points=points, resolution_mm=resolution_mm), recipe).growth is None
    third = replace(press, points=(*press.points, point(4.60, 47.0)))
    assert judge(third, recipe).growth, "the third is a count further"
    far = judge(replace(press, points=(point(4.20, 42.0), point(4.60, 58.0))), recipe)
    assert far.growth
    assert Reason.GROWTH_OVER_LIMIT in far.reasons, "a count further it is evidence"


def test_two_images_of_one_count_of_the_gripper_show_no_onset():
    recipe = recipe_with("blueberry", {8: 149}, 18.6, (190, 24.8))
    press = Press(16.0, 0.4, (point(7.96, 99.7), point(8.0, 100.0)), resolution_mm=0.374)
    assert Reason.AREA_NOT_RISING in judge(press, recipe).reasons
    whole = replace(press, points=(*(point(float(step), 12.5 * step) for step in range(4, 8)), *press.points))
    assert Reason.AREA_NOT_RISING not in judge(whole, recipe).reasons


def test_a_soft_fruit_fails_with_value_limit_and_closing():
    verdict = judge(pressed(48), STRAWBERRY)
    assert verdict.outcome == "FAIL"
    assert verdict.reasons == (Reason.GROWTH_OVER_LIMIT, Reason.EARLY_STOP)
    growth = verdict.findings[0]
    assert (growth.value, growth.limit, growth.closing_mm) == (pytest.approx(48), 41, 4)
    assert growth.message.id == messages.GROWTH_OVER.id
    assert growth.message.parameters == {
        "from_mm": 2.0,
        "to_mm": 4.0,
        "growth": pytest.approx(48),
        "uncertainty": pytest.approx(6.8, abs=0.05),
        "limit": 41,
    }


def test_an_early_stop_before_the_threshold_proves_the_area_over_it():
    points = tuple(point(0.5 * step, 70.0 * 0.5 * step) for step in range(7))
    verdict = judge(Press(35.0, 0.2, points), STRAWBERRY)
    assert verdict.outcome == "FAIL"
    assert Reason.AREA_OVER_LIMIT in verdict.reasons
    over = verdict.findings[0].message
    assert over.id == messages.AREA_OVER.id
    assert over.parameters["area_mm2"] == pytest.approx(197.7, abs=0.05)
    assert over.parameters["limit"] == messages.LIMIT(limit_mm2=165.0)
    assert verdict.deciding == points[-1]


@pytest.mark.parametrize(
    ("area", "reason"), [(155.0, None), (160.0, Reason.NEAR_LIMIT), (200.0, Reason.AREA_OVER_LIMIT)]
)
def test_an_area_about_its_limit_neither_passes_nor_fails(area, reason):
    recipe = STRAWBERRY.model_copy(
        update={
            "damage": STRAWBERRY.damage.model_copy(update={"growth_mm2_per_mm": 100.0}),
            "early_stop": STRAWBERRY.early_stop.model_copy(update={"area_mm2": 260.0, "growth_mm2_per_mm": 100.0}),
        }
    )
    press = Press(35.0, 0.0, tuple(point(float(c), area + (c - 4) * area / 4) for c in range(5)))
    press = replace(press, points=(*press.points, *(point(float(c), area + 5 * (c - 4)) for c in range(5, 13))))
    verdict = judge(press, recipe)
    outcomes = {None: "PASS", Reason.NEAR_LIMIT: "NO_RESULT", Reason.AREA_OVER_LIMIT: "FAIL"}
    assert (verdict.outcome, verdict.reasons) == (outcomes[reason], (reason,) if reason else ())


@pytest.mark.parametrize(
    ("flag", "reason", "message"),
    [
        (Flag.NO_CONTACT, Reason.CONTACT_LOST, messages.CONTACT_LOST),
        (Flag.UNDECIDED, Reason.LOW_CONFIDENCE, messages.NO_EDGE),
        (Flag.CUT_BY_BORDER, Reason.CUT_BY_BORDER, messages.CUT_BY_BORDER),
        (Flag.SATURATED, Reason.SATURATED, messages.SATURATED),
        (Flag.REFERENCE_MISMATCH, Reason.REFERENCE_BAD, messages.REFERENCE_MISMATCH),
    ],
)
def test_a_step_that_is_not_trusted_is_no_pass(flag, reason, message):
    verdict = judge(spoilt(pressed(20), 3.0, flag), STRAWBERRY)
    assert (verdict.outcome, verdict.reasons) == ("NO_RESULT", (reason,))
    assert verdict.findings[0].message == message(closings=[messages.CLOSING(closing_mm=3.0)])
    # Beyond the last damage threshold, and on a light touch, it is no criterion.
    for closing in (1.0, 9.0):
        assert judge(spoilt(pressed(15), closing, flag), STRAWBERRY).outcome == "PASS"


def test_a_sound_step_beyond_the_last_threshold_speaks_for_an_uncertain_one_before_it():
    for closing in (2.0, 3.0):
        assert judge(spoilt(pressed(20), closing, Flag.LOW_CONFIDENCE), STRAWBERRY).outcome == "PASS"
    both = spoilt(spoilt(pressed(20), 2.0, confidence=0.1), 3.0, confidence=0.1)
    assert judge(both, STRAWBERRY).outcome == "PASS"
    assert judge(spoilt(both, 4.0, confidence=0.1), STRAWBERRY).reasons == (Reason.LOW_CONFIDENCE,)
    alone = replace(both, points=both.points[:5])
    assert judge(alone, STRAWBERRY).outcome == "NO_RESULT", "one trusted point shows no onset"


@pytest.mark.parametrize(("counted_mm", "outcome"), [(3.9957, "PASS"), (3.93, "NO_RESULT")])
def test_a_step_at_a_threshold_but_for_the_grippers_counts_is_the_last_that_a_pass_asks_for(counted_mm, outcome):
    press = spoilt(pressed(15), 5.0, Flag.CUT_BY_BORDER)
    counted = replace(
        press, points=tuple(replace(p, closing_mm=counted_mm) if p.closing_mm == 4 else p for p in press.points)
    )
    assert judge(counted, STRAWBERRY).outcome == outcome


def test_it_does_not_where_it_may_be_over_the_limit_itself_or_the_onset_was_too_soon():
    over = Press(35.0, 0.0, tuple(point(c, 34.0 * c) for c in (0.0, 1.0, 2.0, 3.4, 4.9, 6.0)))
    assert judge(over, STRAWBERRY).outcome == "PASS"
    assert judge(spoilt(over, 3.4, confidence=0.1), STRAWBERRY).reasons == (Reason.LOW_CONFIDENCE,)
    hidden = Press(35.0, 0.4, tuple(point(float(c), max(2.0, 35.0 * (c - 1.5))) for c in range(6)))
    shown = spoilt(spoilt(hidden, 2.0, area_mm2=60.0, confidence=0.1), 3.0, area_mm2=75.0, confidence=0.1)
    assert Reason.AREA_NOT_RISING in judge(hidden, STRAWBERRY).reasons
    assert judge(shown, STRAWBERRY).outcome == "NO_RESULT", "what hides the late onset is not believed"


@pytest.mark.parametrize("confidence", [None, 0.49])
def test_a_confidence_that_is_low_or_unknown_is_no_pass(confidence):
    verdict = judge(spoilt(pressed(20), 4.0, confidence=confidence), STRAWBERRY)
    assert (verdict.outcome, verdict.reasons) == ("NO_RESULT", (Reason.LOW_CONFIDENCE,))
    message = verdict.findings[0].message
    assert message.id == (messages.NO_CONFIDENCE if confidence is None else messages.LOW_CONFIDENCE).id
    assert (message.parameters.get("confidence"), message.parameters["least"]) == (confidence, 0.5)


def test_a_contact_cut_by_the_border_is_a_lower_bound():
    over = Press(35.0, 0.0, tuple(point(float(c), 45.0 * c, *[Flag.CUT_BY_BORDER][: c > 1]) for c in range(6)))
    assert judge(over, STRAWBERRY).outcome == "FAIL"
    assert judge(spoilt(pressed(20), 4.0, Flag.CUT_BY_BORDER), STRAWBERRY).outcome == "NO_RESULT"


def test_a_contact_whose_edge_was_lost_proves_a_fail_and_never_carries_a_pass():
    over = Press(35.0, 0.0, tuple(point(float(c), 45.0 * c, *[Flag.LOWER_BOUND][: c == 4]) for c in range(6)))
    verdict = judge(over, STRAWBERRY)
    assert verdict.outcome == "FAIL"
    assert Reason.AREA_OVER_LIMIT in verdict.reasons
    spoiled = judge(spoilt(pressed(20), 4.0, Flag.LOWER_BOUND), STRAWBERRY)
    assert (spoiled.outcome, spoiled.reasons) == ("NO_RESULT", (Reason.LOW_CONFIDENCE,))
    assert spoiled.findings[0].message.id == messages.EDGE_LOST.id


def test_the_least_confidence_itself_is_enough():
    assert judge(spoilt(pressed(20), 4.0, confidence=0.5), STRAWBERRY).outcome == "PASS"


def test_a_contact_that_is_cut_and_whose_edge_was_lost_is_a_lower_bound_too():
    flags = (Flag.CUT_BY_BORDER, Flag.LOWER_BOUND)
    over = Press(35.0, 0.0, tuple(point(float(c), 45.0 * c, *flags[: 2 * (c == 4)]) for c in range(6)))
    assert Reason.AREA_OVER_LIMIT in judge(over, STRAWBERRY).reasons


@pytest.mark.parametrize(
    "flags", [(Flag.LOW_CONFIDENCE,), (Flag.LOWER_BOUND,), (Flag.LOW_CONFIDENCE, Flag.LOWER_BOUND)]
)
def test_a_doubtful_step_at_an_earlier_limit_is_settled_by_a_trusted_one_within_the_last_limit(flags):
    two_limits = recipe_with("strawberry", {4: 98, 8: 189}, 41, (190, 55))
    press = pressed(20)
    assert judge(spoilt(press, 4.0, *flags), two_limits).outcome == "PASS"
    over = spoilt(press, 4.0, *flags, area_mm2=100.0)
    assert judge(over, two_limits).outcome != "PASS", "what was measured there still keeps the earlier limit"
    assert judge(spoilt(spoilt(press, 4.0, *flags), 8.0, *flags), two_limits).outcome == "NO_RESULT"


def test_an_edge_that_was_lost_and_found_again_proves_no_growth():
    areas = {0: 0.0, 1: 20.0, 2: 30.0, 3: 85.0, 4: 140.0}
    sound = Press(35.0, 0.0, tuple(point(float(c), area) for c, area in areas.items()))
    grown = judge(replace(sound, points=sound.points[1:]), STRAWBERRY)
    assert (grown.outcome, grown.reasons) == ("FAIL", (Reason.GROWTH_OVER_LIMIT,))
    assert grown.growth
    assert grown.growth.trusted
    for closing in (2.0, 3.0):  # the true area there may have been larger, and the growth after it smaller
        verdict = judge(spoilt(sound, closing, Flag.LOWER_BOUND), STRAWBERRY)
        assert verdict.outcome == "NO_RESULT"
        assert verdict.growth
        assert not verdict.growth.trusted
    last = judge(spoilt(sound, 4.0, Flag.LOWER_BOUND), STRAWBERRY)
    assert last.growth
    assert last.growth.trusted


def test_a_contact_that_is_lost_or_does_not_rise_is_no_result():
    lost = judge(spoilt(pressed(20), 3.0, area_mm2=0.0, area_px=0), STRAWBERRY)
    assert lost.outcome == "NO_RESULT"
    assert {Reason.CONTACT_LOST, Reason.AREA_NOT_RISING} <= set(lost.reasons)
    fallen = judge(spoilt(pressed(20), 4.0, area_mm2=30.0), STRAWBERRY)
    assert (fallen.outcome, fallen.reasons) == ("NO_RESULT", (Reason.AREA_NOT_RISING,))
    points = [messages.POINT(closing_mm=4.0, area_mm2=30.0)]
    assert fallen.findings[0].message == messages.NOT_RISING(points=points, number=1)


def test_one_step_that_does_not_fit_the_others_proves_nothing():
    verdict = judge(spoilt(pressed(20), 3.0, area_mm2=190.0), STRAWBERRY)
    assert verdict.outcome == "NO_RESULT"
    assert Reason.AREA_NOT_RISING in verdict.reasons


def test_an_onset_seen_too_soon_does_not_make_a_soft_fruit_pass():
    late = Press(37.0, 0.4, tuple(point(float(c), max(0.5, 34.0 * (c - 2))) for c in range(7)))
    verdict = judge(late, STRAWBERRY)
    assert verdict.outcome == "NO_RESULT"
    assert verdict.findings[0].message.id == messages.LATE_ONSET.id
    assert verdict.findings[0].message.parameters["begins_mm"] == pytest.approx(2.0, abs=0.05)


@pytest.mark.parametrize(("begins_mm", "late"), [(1.0, False), (1.1, True)])
def test_a_curve_may_begin_a_quarter_of_the_first_limits_closing_after_the_onset(begins_mm, late):
    press = Press(37.0, 0.4, tuple(point(float(c), max(0.0, 30.0 * (c - begins_mm))) for c in range(7)))
    findings = [finding.message.id for finding in judge(press, STRAWBERRY).findings]
    assert (messages.LATE_ONSET.id in findings) is late


def test_nothing_touched_and_a_wrong_fruit():
    nothing = judge(Press(None, 0.0, ()), STRAWBERRY)
    assert (nothing.outcome, nothing.reasons, nothing.deciding) == ("NO_RESULT", (Reason.NO_CONTACT,), None)
    for width in (15.0, 60.0):
        wrong = judge(pressed(48, onset_mm=width), STRAWBERRY)
        assert wrong.outcome == "NO_RESULT"
        assert Reason.OUT_OF_RANGE in wrong.reasons
        message = messages.WRONG_WIDTH(width_mm=width, recipe="Strawberry", smallest_mm=22.0, largest_mm=53.0)
        assert message in [finding.message for finding in wrong.findings]


@pytest.mark.parametrize("reason", [Reason.LATE, Reason.CALLED_OFF, Reason.CAMERA_FAULT, Reason.REFERENCE_BAD])
def test_an_interruption_is_no_result_whatever_was_measured(reason):
    for growth in (15, 48):
        verdict = judge(pressed(growth, interruptions=(reason,)), STRAWBERRY)
        assert verdict.outcome == "NO_RESULT"
        assert reason in verdict.reasons


def test_steps_that_end_for_no_reason_are_not_taken_for_a_pass():
    short = judge(pressed(20, to_mm=6), STRAWBERRY)
    assert (short.outcome, short.reasons) == ("NO_RESULT", (Reason.INTERNAL_FAULT,))
    assert short.findings[0].message == messages.STEPS_ENDED(reached_mm=6.0, wanted_mm=12.0)
    a_step_short = judge(pressed(15, to_mm=11), STRAWBERRY)
    assert STRAWBERRY.steps.step_mm == 1.0
    assert (a_step_short.reasons, a_step_short.partial) == ((Reason.INTERNAL_FAULT,), True)
    missing = judge(pressed(20, to_mm=3, interruptions=(Reason.GRIPPER_FAULT,)), STRAWBERRY)
    assert missing.reasons == (Reason.GRIPPER_FAULT,), "what ended the steps is known: no fault of the program"
    assert missing.partial
    assert missing.areas[0].area_mm2 is None


def test_the_closing_limit_ends_the_steps():
    press = pressed(15)
    assert early_stop(press, STRAWBERRY) is None
    stop = early_stop(replace(press, points=(*press.points, point(12.5, 190.0))), STRAWBERRY)
    assert stop
    assert stop.message == messages.STOPPED_CLOSING(closing_mm=12.5, limit_mm=12.5)


def test_a_stop_before_a_limit_says_that_the_area_there_is_unknown():
    points = tuple(point(float(c), 24.0 * c, Flag.CUT_BY_BORDER) for c in range(3))
    recipe = STRAWBERRY.model_copy(update={"early_stop": STRAWBERRY.early_stop.model_copy(update={"area_mm2": 40.0})})
    verdict = judge(Press(35.0, 1.0, points), recipe)
    (why,) = [finding.message for finding in verdict.findings if finding.reason == Reason.EARLY_STOP]
    assert why == SENTENCES(
        sentences=[
            messages.STOPPED_AREA(closing_mm=2.0, area_mm2=48.0, limit_mm2=40.0),
            messages.AREA_UNKNOWN(closing_mm=4.0),
        ]
    )


def test_steps_that_share_a_closing_are_one_of_the_least_trust():
    press = pressed(20)
    doubled = replace(press, points=(*press.points, point(4.0, 120.0, confidence=0.2)))
    verdict = judge(doubled, STRAWBERRY)
    assert Reason.LOW_CONFIDENCE in verdict.reasons
    assert verdict.areas[0].area_mm2 == 120.0


def test_a_point_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="finite"):
        replace(point(1.0, 1.0), area_mm2=float("nan"))
    with pytest.raises(ValueError, match="negative"):
        replace(point(1.0, 1.0), area_px=-1)


FLAGS = st.sets(st.sampled_from(list(Flag)), max_size=1)
STEPS = st.tuples(st.floats(0, 60), st.one_of(st.just(0.9), st.floats(0, 1), st.none()), st.just(set()) | FLAGS)


@st.composite
def presses(draw: st.DrawFn) -> Press:
    """Mostly rising curves of plain or of doubtful steps."""
    steps = draw(st.lists(STEPS, min_size=0, max_size=18))
    steep, area = draw(st.sampled_from([0.3, 1.0])), 0.0
    points: list[Measured] = []
    for number, (growth, confidence, flags) in enumerate(steps):
        area += growth * steep
        points.append(point(number * draw(st.sampled_from([1.0, 0.97])), area, *flags, confidence=confidence))
    onset = draw(st.sampled_from([15.0, 15.0, 30.0, None]))
    late = draw(st.sampled_from([(), (), (Reason.LATE,)]))
    return Press(onset, draw(st.sampled_from([0.0, 0.4, 1.0])), tuple(points), late)


RECIPES = st.sampled_from([STRAWBERRY, BLUEBERRY])
EVEN = st.floats(3, 60).map(lambda growth: Press(15.0, 0.4, tuple(point(float(c), growth * c) for c in range(17))))
PRESSES = presses() | EVEN


@given(PRESSES, RECIPES, st.lists(st.floats(0, 20), min_size=18, max_size=18))
def test_more_area_never_turns_fail_into_pass(press, recipe, more):
    added, points = 0.0, []
    for step, extra in zip(sorted(press.points, key=lambda p: p.closing_mm), more, strict=False):
        added += extra
        points.append(replace(step, area_mm2=step.area_mm2 + added))
    if judge(press, recipe).outcome == "FAIL":
        assert judge(replace(press, points=tuple(points)), recipe).outcome != "PASS"


@given(PRESSES, RECIPES, st.floats(1, 3))
def test_a_larger_press_never_turns_fail_into_pass(press, recipe, factor):
    larger = tuple(replace(p, area_mm2=p.area_mm2 * factor) for p in press.points)
    if judge(press, recipe).outcome == "FAIL":
        assert judge(replace(press, points=larger), recipe).outcome != "PASS"


@given(PRESSES, RECIPES, st.integers(0, 17), st.sampled_from([*Flag, None]), st.sampled_from([*Reason, None]))
def test_less_trust_never_gives_a_pass(press, recipe, number, flag, reason):
    points = list(press.points)
    if number < len(points):
        doubted = replace(points[number], flags=points[number].flags | ({flag} if flag else set()), confidence=0.0)
        points[number] = doubted
    interruptions = (*press.interruptions, *([reason] if reason else []))
    doubtful = replace(press, points=tuple(points), interruptions=interruptions)
    if judge(press, recipe).outcome != "PASS":
        assert judge(doubtful, recipe).outcome != "PASS"
    if reason:
        assert judge(doubtful, recipe).outcome == "NO_RESULT"


@given(PRESSES, RECIPES, st.integers())
def test_the_order_of_the_points_does_not_matter(press, recipe, seed):
    shuffled = list(press.points)
    Random(seed).shuffle(shuffled)
    assert judge(replace(press, points=tuple(shuffled)), recipe) == judge(press, recipe)


def in_other_units(recipe: Recipe, factor: float) -> Recipe:
    """The recipe with its areas in a unit `factor` times smaller."""
    damage, stop = recipe.damage, recipe.early_stop
    area = tuple(limit.model_copy(update={"area_mm2": limit.area_mm2 * factor}) for limit in damage.area)
    growth = damage.growth_mm2_per_mm * factor
    limits = {"area_mm2": stop.area_mm2 * factor, "growth_mm2_per_mm": stop.growth_mm2_per_mm * factor}
    return recipe.model_copy(
        update={
            "damage": damage.model_copy(update={"area": area, "growth_mm2_per_mm": growth}),
            "early_stop": stop.model_copy(update=limits),
        }
    )


@given(PRESSES, RECIPES, st.sampled_from([0.25, 4.0, 1024.0]))
def test_the_unit_of_the_areas_does_not_matter(press, recipe, factor):
    scaled = tuple(replace(p, area_mm2=p.area_mm2 * factor) for p in press.points)
    there, here = judge(replace(press, points=scaled), in_other_units(recipe, factor)), judge(press, recipe)
    assert (there.outcome, there.reasons, there.partial) == (here.outcome, here.reasons, here.partial)


NO_LIMIT = {messages.STOPPED_UNTRUSTED.id}
"""Of a press that is not trusted, with any value."""


@given(PRESSES, RECIPES)
def test_every_verdict_explains_itself(press, recipe):
    verdict = judge(press, recipe)
    assert (verdict.outcome == "PASS") == (not verdict.findings)
    if verdict.outcome == "FAIL":
        assert any(finding.proves for finding in verdict.findings)
    for finding in verdict.findings:
        text = str(finding.message)
        assert text[0].isupper()
        assert text.endswith(".")
        if finding.limit is not None and finding.value is not None and finding.message.id not in NO_LIMIT:
            assert any(f"{finding.limit:{form}}" in text for form in ("g", ".1f"))
    assert early_stop(press, recipe) == verdict.stopped


def test_both_passes_and_fails_are_drawn():
    outcomes = {judge(Press(15.0, 0.4, tuple(point(float(c), g * c) for c in range(17))), BLUEBERRY).outcome
                for g in (8.0, 16.5, 30.0)}  # fmt: skip
    assert outcomes == {"PASS", "NO_RESULT", "FAIL"}


def with_least_area(least_mm2: float) -> Recipe:
    """The strawberry's, with a least area at its limit."""
    threshold = STRAWBERRY.damage.area[0].model_copy(update={"least_area_mm2": least_mm2})
    damage = STRAWBERRY.damage.model_copy(update={"area": (threshold,)})
    return STRAWBERRY.model_copy(update={"damage": damage})


def growing_to(area_mm2: float, *flags: Flag) -> Press:
    """A press up to 5 mm that shows this area at 4 mm."""
    return Press(35.0, 0.4, tuple(point(float(closing), area_mm2 * closing / 4, *flags) for closing in range(6)))


def stopped(press: Press, recipe: Recipe) -> list[bool]:
    """Return for each point of a press whether the steps end after it."""
    return [
        early_stop(replace(press, points=press.points[:number]), recipe) is not None
        for number in range(1, len(press.points) + 1)
    ]


def test_what_cannot_pass_any_more_is_not_pressed_on():
    recipe = with_least_area(60.0)
    assert stopped(growing_to(100), recipe) == [False] * 6
    assert stopped(growing_to(55), recipe) == [False] * 4 + [True] * 2, "less than any fruit's"
    assert stopped(growing_to(100, Flag.LOW_CONFIDENCE), recipe) == [False] * 4 + [True] * 2
    small = judge(growing_to(55), recipe)
    assert small.outcome == "NO_RESULT"
    assert Reason.LOW_CONFIDENCE in small.reasons


def test_an_area_as_large_as_the_least_with_its_uncertainty_is_pressed_on():
    area = next(each for each in judge(growing_to(70), STRAWBERRY).areas if each.closing_mm == 4)
    assert area.area_mm2 is not None
    assert area.uncertainty_mm2 is not None
    assert stopped(growing_to(70), with_least_area(area.area_mm2 - area.uncertainty_mm2)) == [False] * 6


DECIDING = STRAWBERRY.model_copy(update={"steps": STRAWBERRY.steps.model_copy(update={"stop_when_decided": True})})


def steps_made(growth: float, *flags: Flag, recipe: Recipe = DECIDING, **changes: Any) -> Press:
    """A strawberry pressed by `recipe`, its area growing evenly, until nothing more is to be learnt."""
    press = replace(Press(35.0, 0.4, ()), **changes)
    for closing in range(13):
        flagged = flags if closing == 3 else ()
        press = replace(press, points=(*press.points, point(float(closing), 2 + growth * closing, *flagged)))
        if early_stop(press, recipe):
            return press
    return press


@pytest.mark.parametrize(
    ("growth", "flags", "changes", "outcome", "last_mm", "why"),
    [
        (20, (), {}, "PASS", 4, messages.STOPPED_KEPT),
        (40, (), {}, "NO_RESULT", 4, messages.STOPPED_CANNOT_PASS),
        (20, (Flag.CUT_BY_BORDER,), {}, "NO_RESULT", 4, messages.STOPPED_CANNOT_PASS),
        (60, (), {}, "FAIL", 3, messages.STOPPED_DAMAGED),
        (20, (), {"onset_mm": 60.0}, "NO_RESULT", 0, messages.STOPPED_VOID),
    ],
)
def test_no_step_is_made_that_could_not_change_the_outcome(growth, flags, changes, outcome, last_mm, why):
    early = DECIDING.early_stop.model_copy(update={"area_mm2": 250.0, "growth_mm2_per_mm": 90.0})
    recipe = DECIDING.model_copy(update={"early_stop": early})
    press = steps_made(growth, *flags, recipe=recipe, **changes)
    verdict = judge(press, recipe)
    assert verdict.outcome == outcome
    assert (press.points[-1].closing_mm, verdict.partial) == (last_mm, last_mm < 4)
    assert verdict.stopped
    assert verdict.stopped.finding is None
    assert verdict.stopped.message == why(closing_mm=last_mm)
    assert not {Reason.EARLY_STOP, Reason.INTERNAL_FAULT} & set(verdict.reasons)


def test_a_press_that_goes_on_after_the_decision_is_decided_alike():
    for growth in (10, 20, 30):
        stopped = steps_made(growth)
        whole = replace(stopped, points=tuple(point(float(c), 2 + growth * c) for c in range(13)))
        assert judge(stopped, DECIDING).outcome == judge(whole, DECIDING).outcome
        assert len(stopped.points) == 5
    assert len(steps_made(10, recipe=STRAWBERRY).points) == 13


def test_an_onset_that_uncertain_steps_hide_gets_one_more_step_to_show_itself():
    press = spoilt(spoilt(steps_made(20), 2.0, confidence=0.1), 3.0, confidence=0.1)
    assert judge(press, DECIDING).outcome == "NO_RESULT"
    assert early_stop(press, DECIDING) is None
    more = replace(press, points=(*press.points, point(5.0, 102.0)))
    assert judge(more, DECIDING).outcome == "PASS"
    assert early_stop(more, DECIDING)


def test_a_doubtful_onset_does_not_press_a_fruit_on_to_the_early_stop():
    def late(to_mm: int, **second: Any) -> Press:
        points = [point(float(c), max(2.0, 30.0 * (c - 1.5))) for c in range(to_mm + 1)]
        points[2] = replace(points[2], **second)
        return Press(35.0, 0.4, tuple(points))

    assert judge(late(4), DECIDING).reasons == (Reason.AREA_NOT_RISING,)
    assert early_stop(late(3), DECIDING) is None
    stop = early_stop(late(4), DECIDING)
    assert stop is not None
    assert stop.message.id == messages.STOPPED_CANNOT_PASS.id
    # An excused step may hide where the onset was; one more step shows it, and a third shows nothing new.
    hides = {"confidence": 0.1, "area_mm2": 60.0}
    assert early_stop(late(5, **hides), DECIDING) is not None


def first_trusted(growth: float, doubtful_mm: tuple[float, ...] = (), flag: Flag = Flag.LOW_CONFIDENCE) -> Press:
    """A strawberry pressed by limits of 50 mm² at 2 mm and 100 mm² at 4 mm, of which the first trusted decides."""
    press = Press(35.0, 0.4, ())
    for closing in range(7):
        flags = (flag,) if closing in doubtful_mm else ()
        press = replace(press, points=(*press.points, point(float(closing), growth * closing, *flags)))
        if early_stop(press, FIRST_TRUSTED):
            return press
    return press


_AREAS = tuple(
    STRAWBERRY.damage.area[0].model_copy(update={"closing_mm": closing_mm, "area_mm2": area_mm2})
    for closing_mm, area_mm2 in ((2.0, 50.0), (4.0, 100.0))
)
FIRST_TRUSTED = DECIDING.model_copy(
    update={"damage": DECIDING.damage.model_copy(update={"area": _AREAS, "decided_by": "first_trusted"})}
)


@pytest.mark.parametrize(
    ("growth", "doubtful_mm", "flag", "outcome", "last_mm"),
    [
        (15, (), Flag.LOW_CONFIDENCE, "PASS", 2),
        (33, (), Flag.LOW_CONFIDENCE, "FAIL", 2),
        (24.5, (), Flag.LOW_CONFIDENCE, "NO_RESULT", 2),
        (15, (2,), Flag.LOW_CONFIDENCE, "PASS", 4),
        (15, (2,), Flag.CUT_BY_BORDER, "NO_RESULT", 4),
        (33, (2,), Flag.CUT_BY_BORDER, "FAIL", 2),
        (15, (2, 4), Flag.LOW_CONFIDENCE, "NO_RESULT", 4),
        (15, (4,), Flag.CUT_BY_BORDER, "PASS", 2),
    ],
)
def test_the_first_limit_whose_area_is_trusted_decides(growth, doubtful_mm, flag, outcome, last_mm):
    press = first_trusted(growth, doubtful_mm, flag)
    verdict = judge(press, FIRST_TRUSTED)
    assert (verdict.outcome, press.points[-1].closing_mm) == (outcome, last_mm), verdict.findings


EVERY_TRUSTED = FIRST_TRUSTED.model_copy(
    update={"damage": FIRST_TRUSTED.damage.model_copy(update={"decided_by": "every_trusted"})}
)


def every_trusted(at_2_mm2: float, at_4_mm2: float, doubtful_mm: tuple[float, ...], flag: Flag) -> Press:
    """A strawberry pressed by the same limits, each of which has to be met where its area is trusted."""
    press = Press(35.0, 0.4, ())
    areas_mm2 = (0.0, at_2_mm2 / 2, at_2_mm2, (at_2_mm2 + at_4_mm2) / 2, at_4_mm2, 1.25 * at_4_mm2)
    for closing, area_mm2 in enumerate(areas_mm2):
        flags = (flag,) if closing in doubtful_mm else ()
        press = replace(press, points=(*press.points, point(float(closing), area_mm2, *flags)))
        if early_stop(press, EVERY_TRUSTED):
            return press
    return press


@pytest.mark.parametrize(
    ("at_2_mm2", "at_4_mm2", "doubtful_mm", "flag", "outcome", "last_mm"),
    [
        (30, 60, (), Flag.LOW_CONFIDENCE, "PASS", 4),
        (30, 98, (), Flag.LOW_CONFIDENCE, "NO_RESULT", 4),
        (40, 121, (), Flag.LOW_CONFIDENCE, "FAIL", 4),
        (49, 60, (), Flag.LOW_CONFIDENCE, "NO_RESULT", 2),
        (70, 80, (), Flag.LOW_CONFIDENCE, "FAIL", 2),
        (30, 60, (2,), Flag.LOW_CONFIDENCE, "PASS", 4),
        (30, 60, (4,), Flag.CUT_BY_BORDER, "PASS", 4),
        (30, 98, (4,), Flag.CUT_BY_BORDER, "NO_RESULT", 4),
        (30, 60, (2, 4), Flag.CUT_BY_BORDER, "NO_RESULT", 4),
    ],
)
def test_every_limit_whose_area_is_trusted_has_to_be_kept(at_2_mm2, at_4_mm2, doubtful_mm, flag, outcome, last_mm):
    press = every_trusted(at_2_mm2, at_4_mm2, doubtful_mm, flag)
    verdict = judge(press, EVERY_TRUSTED)
    assert (verdict.outcome, press.points[-1].closing_mm) == (outcome, last_mm), verdict.findings


@pytest.mark.parametrize(("last_mm2", "outcome"), [(0, "NO_RESULT"), (20, "NO_RESULT"), (60, "PASS")])
def test_an_earlier_limit_passes_no_fruit_whose_area_does_not_rise_up_to_the_last(last_mm2, outcome):
    points = (point(0.0, 4), point(1.0, 15), point(2.0, 30), point(4.0, last_mm2, Flag.LOW_CONFIDENCE))
    assert judge(Press(35.0, 0.4, points), EVERY_TRUSTED).outcome == outcome


def at_both_limits(at_2: Measured, at_4: Measured, least_mm2: tuple[float, float] = (0.0, 0.0)) -> tuple[Press, Recipe]:
    """A strawberry measured at both limits, 50 and 100 mm², and before."""
    limits = tuple(
        limit.model_copy(update={"least_area_mm2": least})
        for limit, least in zip(EVERY_TRUSTED.damage.area, least_mm2, strict=True)
    )
    recipe = EVERY_TRUSTED.model_copy(update={"damage": EVERY_TRUSTED.damage.model_copy(update={"area": limits})})
    between = point(3.0, (at_2.area_mm2 + at_4.area_mm2) / 2)
    points = (point(0.0, 2), point(1.0, at_2.area_mm2 / 2), at_2, between, at_4)
    return Press(35.0, 0.4, points), recipe


@pytest.mark.parametrize(
    ("at_4_mm2", "outcome", "reasons_of"),
    [(98, "NO_RESULT", (Reason.NEAR_LIMIT,)), (125, "FAIL", (Reason.AREA_OVER_LIMIT,))],
)
def test_an_area_near_an_earlier_limit_hides_no_proof_at_a_later_one(at_4_mm2, outcome, reasons_of):
    """As where every step is made for its curve, or the jaws close without a stop."""
    verdict = judge(*at_both_limits(point(2.0, 49), point(4.0, at_4_mm2)))
    assert (verdict.outcome, verdict.reasons) == (outcome, reasons_of)
    assert {finding.closing_mm for finding in verdict.findings} == {2.0 if outcome == "NO_RESULT" else 4.0}


def by_both_limits(at_2: Measured, at_4: Measured, least_mm2: tuple[float, float] = (0.0, 0.0)) -> str:
    """The outcome of such a strawberry."""
    return judge(*at_both_limits(at_2, at_4, least_mm2)).outcome


@pytest.mark.parametrize(
    ("flags", "outcome"),
    [
        ((Flag.LOW_CONFIDENCE,), "PASS"),
        ((Flag.CUT_BY_BORDER, Flag.LOW_CONFIDENCE), "PASS"),
        ((Flag.LOWER_BOUND,), "PASS"),
        ((Flag.LOWER_BOUND, Flag.CUT_BY_BORDER, Flag.LOW_CONFIDENCE), "PASS"),
        ((Flag.SATURATED,), "NO_RESULT"),
        ((Flag.REFERENCE_MISMATCH, Flag.LOW_CONFIDENCE), "NO_RESULT"),
        ((Flag.UNDECIDED,), "NO_RESULT"),
        ((Flag.CUT_BY_BORDER, Flag.SATURATED), "NO_RESULT"),
    ],
)
def test_an_earlier_limit_decides_only_where_the_last_area_may_be_larger_than_was_seen(flags, outcome):
    assert by_both_limits(point(2.0, 30), point(4.0, 60, *flags)) == outcome


def test_an_area_at_the_last_limit_that_is_no_fruits_is_not_judged_by_an_earlier_one():
    assert by_both_limits(point(2.0, 30), point(4.0, 60), (20.0, 50.0)) == "PASS"
    assert by_both_limits(point(2.0, 30), point(4.0, 40), (20.0, 50.0)) == "NO_RESULT"
    assert by_both_limits(point(2.0, 30), point(4.0, 40, Flag.CUT_BY_BORDER), (20.0, 50.0)) == "NO_RESULT"


def test_an_area_is_a_fruits_where_its_least_is_as_much_as_the_least_of_any_fruit():
    at_2, at_4 = point(2.0, 30), point(4.0, 60, Flag.CUT_BY_BORDER)
    press, recipe = at_both_limits(at_2, at_4)
    found = Evidence(press, sized_limits(press, recipe)).area_at(4.0)
    assert found is not None
    area_mm2, uncertainty_mm2 = found
    assert by_both_limits(at_2, at_4, (0.0, area_mm2 - uncertainty_mm2)) == "PASS"
    assert by_both_limits(at_2, at_4, (0.0, area_mm2)) == "NO_RESULT"


@pytest.mark.parametrize(
    ("at_2_mm2", "flags", "outcome"),
    [
        (55, (Flag.LOWER_BOUND,), "NO_RESULT"),
        (49, (Flag.CUT_BY_BORDER,), "NO_RESULT"),
        (40, (Flag.LOWER_BOUND,), "PASS"),
        (55, (Flag.LOW_CONFIDENCE,), "PASS"),  # it may as well be smaller
    ],
)
def test_a_cut_or_lost_edge_that_reaches_an_earlier_limit_keeps_the_fruit_from_passing_by_the_last(
    at_2_mm2, flags, outcome
):
    assert by_both_limits(point(2.0, at_2_mm2, *flags), point(4.0, 85)) == outcome


@pytest.mark.parametrize(("limit_mm2", "outcome"), [(90, "PASS"), (62, "NO_RESULT")])
def test_a_cut_and_lost_edge_that_reaches_its_limit_is_not_passed_by_the_limit_before_it(limit_mm2, outcome):
    press, recipe = at_both_limits(point(2.0, 35), point(4.0, 85))
    first, last = recipe.damage.area
    between = last.model_copy(update={"closing_mm": 3.0, "area_mm2": limit_mm2})
    three = recipe.damage.model_copy(update={"area": (first, between, last)})
    cut_and_lost = spoilt(press, 3.0, Flag.CUT_BY_BORDER, Flag.LOWER_BOUND)
    assert judge(cut_and_lost, recipe.model_copy(update={"damage": three})).outcome == outcome


@pytest.mark.parametrize("growth", [15, 48])
def test_a_fruit_that_every_image_shows_touched_is_neither_passed_nor_failed(growth):
    verdict = judge(pressed(growth, onset_uncertainty_mm=None), STRAWBERRY)
    assert verdict.outcome == "NO_RESULT"
    [finding] = [each for each in verdict.findings if each.message == messages.TOUCHED_AT_FIRST(width_mm=35.0)]
    assert (finding.reason, finding.value, finding.closing_mm) == (Reason.OUT_OF_RANGE, 35.0, 0.0)


def test_a_recipe_says_when_not_every_limit_decides():
    assert "decided_by" not in DECIDING.model_dump(mode="json")["damage"], "older recipes keep their content hash"
    recipes = (DECIDING, FIRST_TRUSTED, EVERY_TRUSTED)
    assert [recipe.damage.deciding_closing_mm for recipe in recipes] == [4, 2, 2]
    assert [recipe.damage.passing_closing_mm for recipe in recipes] == [4, 2, 4]
    both = FIRST_TRUSTED.model_copy(
        update={"damage": FIRST_TRUSTED.damage.model_copy(update={"decided_by": "every_limit"})}
    )
    assert judge(first_trusted(15), both).outcome == "NO_RESULT", "the second limit is not reached"
