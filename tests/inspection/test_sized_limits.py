"""Limits for the fruit's size: what a grader's length makes of them, and sizes that are not believed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.inspection.fruit_size import NO_SIZE, FruitSize
from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.inspection.sized_limits import SizedLimits, sized_limits
from station.messages import judge as messages
from station.messages.message import Message
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.vocabulary import Reason

SIZE = {
    "from": "length",
    "reference_mm": 40.0,
    "exponent": 0.8,
    "expected_length": {"smallest_mm": 20.0, "largest_mm": 70.0},
    "expected_ratio": {"smallest": 0.8, "largest": 2.0},
    "uncertainty_mm": 0.6,
    "classes": [
        {"number": 2, "smallest_mm": 30.0, "largest_mm": 40.0},
        {"number": 5, "smallest_mm": 40.0, "largest_mm": 50.0},
    ],
    "without_size": "no_result",
    "spread": 0.17,
}


def recipe_with(**changes: object) -> Recipe:
    """A strawberry's of another release, with one limit of 100 mm² at 3 mm for a fruit of 40 mm."""
    golden = Path(__file__).parents[1] / "recipe_store" / "golden" / "form_1"
    values = find_recipe("strawberry", golden).model_dump(mode="json")
    values["damage"] = {
        "area": [{"closing_mm": 3.0, "area_mm2": 100.0, "least_area_mm2": 40.0}],
        "growth_mm2_per_mm": 60.0,
        "size": {**SIZE, **changes},
        "uncertainty": {"coverage": 0.95, "repeatability": [{"closing_mm": 3.0, "relative": 0.03}]},
    }
    values["early_stop"] = {"area_mm2": 120.0, "growth_mm2_per_mm": 80.0}
    values["steps"]["stop_when_decided"] = True
    return Recipe.model_validate_json(json.dumps(values))


RECIPE = recipe_with()


def pressed(area_mm2: float, size: FruitSize, width_mm: float = 35.0) -> Press:
    """A fruit that shows this area at 3 mm."""
    points = tuple(Measured(float(c), area_mm2 * c / 3, 1000 * c, 0.9) for c in range(4))
    return Press(width_mm, 0.0, points, size=size)


@pytest.mark.parametrize("length_mm", [30.0, 40.0, 55.5])
def test_every_limit_goes_with_the_length(length_mm):
    limits = sized_limits(pressed(80, FruitSize(length_mm)), RECIPE)
    factor = (length_mm / 40) ** 0.8
    (threshold,) = limits.recipe.damage.area
    assert (threshold.area_mm2, threshold.least_area_mm2) == (pytest.approx(100 * factor), pytest.approx(40 * factor))
    assert limits.recipe.damage.growth_mm2_per_mm == pytest.approx(60 * factor)
    assert limits.recipe.early_stop.area_mm2 == pytest.approx(120 * factor)
    assert limits.recipe.early_stop.growth_mm2_per_mm == pytest.approx(80 * factor)
    assert limits.relative_uncertainty == pytest.approx(0.8 * 0.6 / length_mm)


def test_one_area_is_damage_in_a_short_fruit_and_sound_in_a_long_one():
    short, middle, long = (judge(pressed(98, FruitSize(length)), RECIPE) for length in (32.0, 40.0, 48.0))
    assert (short.outcome, middle.outcome, long.outcome) == ("FAIL", "NO_RESULT", "PASS")
    over = messages.LIMIT_OF_LENGTH(fruit="Strawberry", length_mm=32.0, limit_mm2=100 * (32 / 40) ** 0.8)
    assert short.findings[0].message.id == messages.AREA_OVER.id
    assert short.findings[0].message.parameters == {
        "closing_mm": 3.0, "area_mm2": pytest.approx(92.6, abs=0.05), "limit": over
    }  # fmt: skip
    near = messages.LIMIT_OF_LENGTH(fruit="Strawberry", length_mm=40.0, limit_mm2=100.0)
    assert middle.findings[0].message.id == messages.AREA_NEAR.id
    assert middle.findings[0].message.parameters == {
        "closing_mm": 3.0, "area_mm2": 98.0, "uncertainty_mm2": pytest.approx(5.2, abs=0.05), "limit": near
    }  # fmt: skip
    assert middle.reasons == (Reason.NEAR_LIMIT,)
    assert long.areas[0].limit_mm2 == pytest.approx(115.7, abs=0.05)


def test_a_class_is_as_long_as_its_middle_and_as_uncertain_as_it_is_wide():
    limits = sized_limits(pressed(80, FruitSize(None, 5)), recipe_with(**{"from": "class"}))
    assert limits.length_mm == 45
    assert limits.relative_uncertainty == pytest.approx(0.8 * (10**2 / 12 + 0.6**2) ** 0.5 / 45)


def unexpected(length_mm: float) -> Message:
    return messages.LENGTH_UNEXPECTED(length_mm=length_mm, recipe="Strawberry", smallest_mm=20.0, largest_mm=70.0)


WRONG = {
    "impossible": (FruitSize(6553.5), unexpected(6553.5)),
    "too short": (FruitSize(16.0), unexpected(16.0)),
    "no class": (FruitSize(45.0, 65535), messages.CLASS_UNLISTED(number=65535)),
    "contradiction": (
        FruitSize(45.0, 2),
        messages.SIZE_CONTRADICTS(length_mm=45.0, number=2, smallest_mm=30.0, largest_mm=40.0),
    ),
    "another fruit's": (FruitSize(26.0), messages.LENGTH_OF_ANOTHER(length_mm=26.0, width_mm=35.0)),
}


@pytest.mark.parametrize(("size", "message"), WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("fallback", ["no_result", "plain_limit"])
@pytest.mark.parametrize("judged_by", ["length", "class"])
def test_a_size_that_cannot_be_is_no_result_whatever_the_recipe_does_without(size, message, fallback, judged_by):
    recipe = recipe_with(without_size=fallback, **{"from": judged_by})
    for area_mm2 in (70, 300):
        verdict = judge(pressed(area_mm2, size), recipe)
        assert (verdict.outcome, verdict.reasons) == ("NO_RESULT", (Reason.SIZE_UNKNOWN,))
        assert verdict.findings[0].message == message
    first = pressed(70, size)
    assert early_stop(replace(first, points=first.points[:1]), recipe), "no step can change it"


@pytest.mark.parametrize(
    ("size", "width_mm", "fits"),
    [
        # The expected lengths are 20 to 70 mm, and 0.8 to 2 times the width.
        (FruitSize(20.0), 20.0, True),
        (FruitSize(19.9), 20.0, False),
        (FruitSize(70.0), 40.0, True),
        (FruitSize(70.1), 40.0, False),
        (FruitSize(28.0), 35.0, True),
        (FruitSize(27.9), 35.0, False),
        (FruitSize(60.0), 30.0, True),
        (FruitSize(60.1), 30.0, False),
        # Class 2 is from 30 to 40 mm; a length within 2 times 0.6 mm of it does not contradict it.
        (FruitSize(41.2, 2), 35.0, True),
        (FruitSize(41.3, 2), 35.0, False),
        (FruitSize(28.8, 2), 35.0, True),
        (FruitSize(28.7, 2), 35.0, False),
        (FruitSize(None, 2), 50.0, True),
        (FruitSize(None, 2), 50.1, False),
        (FruitSize(None, 2), 15.0, True),
        (FruitSize(None, 2), 14.9, False),
    ],
)
def test_up_to_where_a_size_is_believed(size, width_mm, fits):
    limits = sized_limits(pressed(80, size, width_mm), recipe_with(without_size="plain_limit"))
    assert (limits.problem is None) is fits


def test_a_recipe_without_sizes_has_its_limits_as_written():
    values = RECIPE.model_dump(mode="json")
    del values["damage"]["size"]
    plain = Recipe.model_validate_json(json.dumps(values))
    for size in (NO_SIZE, FruitSize(6553.5, 9)):
        assert sized_limits(pressed(80, size), plain) == SizedLimits(
            plain, factor=1.0, length_mm=None, relative_uncertainty=0.0, without_size=False, problem=None
        )


def test_a_length_a_little_outside_its_class_is_within_the_graders_uncertainty():
    assert not sized_limits(pressed(80, FruitSize(41.1, 2)), RECIPE).problem
    assert sized_limits(pressed(80, FruitSize(41.3, 2)), RECIPE).problem
    assert not sized_limits(pressed(80, FruitSize(41.3, 9)), recipe_with(classes=[])).problem, "none are listed"


def test_a_class_of_another_fruit_is_noticed_by_the_width():
    recipe = recipe_with(**{"from": "class"})
    assert not sized_limits(pressed(80, FruitSize(None, 2), width_mm=49.0), recipe).problem, "its longest may be"
    problem = sized_limits(pressed(80, FruitSize(None, 2), width_mm=51.0), recipe).problem
    assert problem == messages.CLASS_OF_ANOTHER(number=2, width_mm=51.0)
    assert not sized_limits(pressed(80, FruitSize(26.0)), recipe_with(expected_ratio=None)).problem


@pytest.mark.parametrize(
    ("judged_by", "size"), [("length", NO_SIZE), ("length", FruitSize(None, 2)), ("class", NO_SIZE)]
)
def test_without_a_size_the_recipe_says_what_is_done(judged_by, size):
    refused = judge(pressed(70, size), recipe_with(**{"from": judged_by}))
    assert (refused.outcome, refused.reasons) == ("NO_RESULT", (Reason.SIZE_UNKNOWN,))
    missing = messages.NO_LENGTH() if judged_by == "length" else messages.NO_CLASS()
    assert refused.findings[0].message == missing
    plain = recipe_with(without_size="plain_limit", **{"from": judged_by})
    assert judge(pressed(75, size), plain).outcome == "PASS"
    near = judge(pressed(90, size), plain)
    assert near.reasons == (Reason.NEAR_LIMIT,), "a fruit of average length would pass, and this may be a short one"
    assert near.findings[0].message.parameters["limit"] == messages.LIMIT_WITHOUT_SIZE(limit_mm2=100.0)
    assert judge(pressed(90, FruitSize(40.0, 5)), plain).outcome == "PASS"


LENGTHS = st.one_of(st.none(), st.floats(0, 6553.5))
CLASSES = st.one_of(st.none(), st.integers(1, 65535))


@given(LENGTHS, CLASSES, st.sampled_from(["length", "class"]), st.sampled_from(["no_result", "plain_limit"]))
def test_no_size_whatever_lets_pass_what_is_too_much_for_the_longest_fruit_of_its_width(length, number, by, without):
    recipe = recipe_with(without_size=without, **{"from": by})
    most_mm2 = 100 * (70 / 40) ** 0.8  # the longest that the recipe expects
    assert judge(pressed(most_mm2, FruitSize(length, number)), recipe).outcome != "PASS"


@given(st.floats(36, 68), st.floats(0.01, 1.9), st.floats(50, 140))
def test_a_shorter_fruit_never_passes_with_an_area_that_a_longer_one_does_not(length, less, area):
    shorter, longer = (
        judge(pressed(area, FruitSize(each)), recipe_with(classes=[])) for each in (length, length + less)
    )
    if longer.outcome != "PASS" and Reason.LOW_CONFIDENCE not in longer.reasons:
        assert shorter.outcome != "PASS"
