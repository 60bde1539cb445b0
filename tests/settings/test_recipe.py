"""Recipes: a mistake is reported with file, line, field and what was expected; the shipped ones are good."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from station.errors import BadInputError
from station.inspection.evidence import AT_MM, LIGHT_TOUCH
from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.messages import settings as messages
from station.settings import recipe_model
from station.settings.damage import AreaUncertainty, Repeatability
from station.settings.gripper import GripperCalibration
from station.settings.problems import Problem, SettingsError
from station.settings.recipe import approved_by_distribution, approved_list, find_recipe, load_recipe, load_recipes
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256
from station.settings.validation import validated
from station.settings.yaml_loader import parse_document

ALIKE = "expected a word that all YAML programs read alike, got"
CLOSING = "a number above 0 and at most 50 mm"
NUMBER = "write a number of at most 18 decimal digits without exponent and leading zeros, or"
PRINTABLE = "expected printable characters: no control characters, none that turn the direction of text"
ONE_STEP = (
    "expected another step before this closing, a multiple of 1 mm from 0.5 to below {below_mm} mm: no fruit passes by "
    "one image alone (make steps.step_mm smaller or the closing larger), got {got}"
)
NO_ROOM = (
    "expected room below area_mm2, {limit} mm²: with a guard band of {guard}% on either side no fruit would pass "
    "(lower it, raise area_mm2, or lower damage.uncertainty), got {got}"
)

# What is changed in the small recipe, by regular expression, and the message that has to follow.
BAD = {
    "text for a number": (
        r"step_mm: 1",
        "step_mm: x",
        ["10: steps.step_mm: expected a number from 0.4 to 5 mm, got 'x'"],
    ),
    "quoted number": (
        r"step_mm: 1",
        "step_mm: '1'",
        ["10: steps.step_mm: expected a number from 0.4 to 5 mm, got '1'"],
    ),
    "truth for a number": (
        r"settle_s: 0.2",
        "settle_s: true",
        ["18: imaging.settle_s: expected a number from 0 to 10 s, got true"],
    ),
    "nothing": (r"force_n: 20", "force_n:", ["16: gripper.force_n: expected a number from 20 to 235 N, got nothing"]),
    "too small": (r"force_n: 20", "force_n: 0", ["16: gripper.force_n: expected a number from 20 to 235 N, got 0"]),
    "broken number of steps": (
        r"number: 8",
        "number: 8.0",
        ["11: steps.number: expected an integer from 1 to 100, got 8.0"],
    ),
    "choice": (r"start: onset", "start: there", ["9: steps.start: expected one of onset, width, got 'there'"]),
    "no list": (
        r"\[4, 8\]",
        "4",
        [f"12: steps.result_closings_mm: expected a list of 1 to 20 items, each {CLOSING}, got 4"],
    ),
    "wrong item": (
        r"\[4, 8\]",
        "[4, -8]",
        ["12: steps.result_closings_mm[1]: expected a number above 0 and at most 50 mm, got -8"],
    ),
    "no mapping": (
        r"gripper:\n.*\n.*\n",
        "gripper: fast\n",
        ["14: gripper: expected a mapping with speed_mm_s, force_n, got 'fast'"],
    ),
    "unknown key": (
        r"speed_mm_s",
        "sped_mm_s",
        [
            "14: gripper.speed_mm_s: expected a number from 20 to 150 mm/s, got nothing",
            "15: gripper.sped_mm_s: unknown key sped_mm_s: did you mean speed_mm_s?",
        ],
    ),
    "unlike any key": (
        r"force_n: 20",
        "force_n: 20\n  zzz: 1",
        ["17: gripper.zzz: unknown key zzz: expected speed_mm_s, force_n"],
    ),
    "unknown in a list": (
        r"- closing_mm: 8",
        "- closing: 8",
        [
            "25: damage.area[1].closing_mm: expected a number above 0 and at most 50 mm, got nothing",
            "25: damage.area[1].closing: unknown key closing: did you mean closing_mm?",
        ],
    ),
    "other version": (
        r"schema_version: 1",
        "schema_version: 2",
        [
            (
                "1: schema_version: expected at most 1, got 2 of a newer fruit-station: "
                "install that, or write the older form"
            ),
        ],
    ),
    "true for the version": (
        r"schema_version: 1",
        "schema_version: true",
        ["1: schema_version: expected 1, got true"],
    ),
    "broken number for the version": (
        r"schema_version: 1",
        "schema_version: 1.0",
        ["1: schema_version: expected 1, got 1.0"],
    ),
    "title that colours the terminal": (
        r"title: Cherry",
        r'title: "\\e[31mCherry"',
        [f"3: title: {PRINTABLE}, got '\\x1b[31mCherry'"],
    ),
    "title that runs backwards": (
        r"title: Cherry",
        r'title: "\\u202eCherry"',
        [f"3: title: {PRINTABLE}, got '\\u202eCherry'"],
    ),
    "even windows": (
        r"damage:",
        "segmentation:\n  paper:\n    template_window_px: 20\n    search_window_px: 8\n    kernel_px: 4\ndamage:",
        [
            "23: segmentation.paper.template_window_px: expected an odd side, got 20",
            "24: segmentation.paper.search_window_px: expected an odd side, got 8",
            "25: segmentation.paper.kernel_px: expected an odd side, got 4",
        ],
    ),
    "only item wrong": (
        r"\[4, 8\]",
        "[x]",
        ["12: steps.result_closings_mm[0]: expected a number above 0 and at most 50 mm, got 'x'"],
    ),
    "name": (
        r"name: cherry",
        "name: Cherry!",
        ["2: name: expected a text that matches ^[a-z][a-z0-9_]{0,31}$, got 'Cherry!'"],
    ),
    "name NO": (
        r"name: cherry",
        "name: NO",
        [f'2: name: {ALIKE} NO: write true or false, or "NO" in quotes for a text'],
    ),
    "PLC number octal": (
        r"plc_number: 7",
        "plc_number: 012",
        [f'4: plc_number: {ALIKE} 012: {NUMBER} "012" in quotes for a text'],
    ),
    "several at once": (
        r"plc_number: 7\nexpected_width:\n  smallest_mm: 20",
        "plc_number: 0\nexpected_width:\n  smallest_mm: .inf",
        [
            "4: plc_number: expected an integer from 1 to 65535, got 0",
            f'6: expected_width.smallest_mm: {ALIKE} .inf: {NUMBER} ".inf" in quotes for a text',
        ],
    ),
    "widths swapped": (
        r"smallest_mm: 20",
        "smallest_mm: 31",
        ["6: expected_width.smallest_mm: expected less than largest_mm, 30 mm, got 31"],
    ),
    "steps beyond the limit": (
        r"number: 8",
        "number: 9",
        ["11: steps.number: expected steps within closing_limit_mm, 8.5 mm, got 9 mm of closing"],
    ),
    "result out of reach": (
        r"\[4, 8\]",
        "[4, 8.2]",
        ["12: steps.result_closings_mm[1]: expected within the steps, 8 mm, got 8.2"],
    ),
    "results unordered": (
        r"\[4, 8\]",
        "[8, 4]",
        ["12: steps.result_closings_mm[1]: expected more than the closing before, got 4"],
    ),
    "width missing": (
        r"start: onset",
        "start: width",
        ["8: steps.start_width_mm: expected a width, as start is 'width'"],
    ),
    "width without use": (
        r"start: onset",
        "start: onset\n  start_width_mm: 40",
        ["10: steps.start_width_mm: expected null, as start is 'onset', got 40"],
    ),
    "closing beyond shut": (
        r"start: onset",
        "start: width\n  start_width_mm: 7.9",
        ["12: steps.number: expected steps within the start width, got 8 mm of closing"],
    ),
    "threshold elsewhere": (
        r"- closing_mm: 8",
        "- closing_mm: 7",
        ["25: damage.area[1].closing_mm: expected one of the results' closings (4, 8), got 7"],
    ),
    "thresholds fall": (
        r"area_mm2: 150",
        "area_mm2: 90",
        ["26: damage.area[1].area_mm2: expected no less than the threshold before, got 90"],
    ),
    "thresholds doubled": (
        r"- closing_mm: 8",
        "- closing_mm: 4",
        ["25: damage.area[1].closing_mm: expected more than the threshold before, got 4"],
    ),
    "judged on one step": (
        r"\[4, 8\](?s:(.*))    - closing_mm: 4\n.*\n(.*)- closing_mm: 8",
        r"[1]\1\2- closing_mm: 1",
        [f"23: damage.area[0].closing_mm: {ONE_STEP.format(below_mm=0.78, got=1)}"],
    ),
    "limits judged on one step together": (
        r"\[4, 8\](?s:(.*))- closing_mm: 4(?s:(.*))- closing_mm: 8",
        r"[1, 1.1]\1- closing_mm: 1\2- closing_mm: 1.1",
        [f"25: damage.area[1].closing_mm: {ONE_STEP.format(below_mm=0.88, got=1.1)}"],
    ),
    "each limit judged by itself": (
        r"\[4, 8\](?s:(.*))damage:(?s:(.*))- closing_mm: 4",
        r"[1, 8]\1damage:\n  decided_by: every_trusted\2- closing_mm: 1",
        [f"24: damage.area[0].closing_mm: {ONE_STEP.format(below_mm=0.78, got=1)}"],
    ),
    "early stop before damage": (
        r"area_mm2: 160\n  growth_mm2_per_mm: 40",
        "area_mm2: 140\n  growth_mm2_per_mm: 20",
        [
            "29: early_stop.area_mm2: expected no less than the largest damage threshold, 150 mm², got 140",
            "30: early_stop.growth_mm2_per_mm: expected no less than the damage threshold, 30 mm²/mm, got 20",
        ],
    ),
    "widths equal": (
        r"smallest_mm: 20",
        "smallest_mm: 30",
        ["6: expected_width.smallest_mm: expected less than largest_mm, 30 mm, got 30"],
    ),
    "closing at a given width": (
        r"start: onset",
        "start: width\n  start_width_mm: 40\n  measured: while_closing",
        ["11: steps.measured: expected 'at_rest', as start is 'width': the way to the limits is not known"],
    ),
    "results doubled": (
        r"\[4, 8\]",
        "[4, 4]",
        [
            "12: steps.result_closings_mm[1]: expected more than the closing before, got 4",
        ],
    ),
    "least area as large as the largest": (
        r"area_mm2: 100",
        "area_mm2: 100\n      least_area_mm2: 100",
        ["25: damage.area[0].least_area_mm2: expected less than area_mm2, 100 mm², got 100"],
    ),
    "no room between the least area and the largest": (
        r"area_mm2: 100",
        "area_mm2: 100\n      least_area_mm2: 85",
        [f"25: damage.area[0].least_area_mm2: {NO_ROOM.format(limit=100, guard=8.2, got=85)}"],
    ),
    "a guard band as large as the area": (
        r"growth_mm2_per_mm: 30",
        (
            "growth_mm2_per_mm: 30\n  uncertainty:\n    repeatability:\n"
            "      - {closing_mm: 4, relative: 0.7}\n      - {closing_mm: 8, relative: 0.5}"
        ),
        [f"23: damage.area[0].least_area_mm2: {NO_ROOM.format(limit=100, guard=115.1, got=0)}"],
    ),
    "coverage unordered": (
        r"growth_mm2_per_mm: 30",
        (
            "growth_mm2_per_mm: 30\n  uncertainty:\n    repeatability:\n"
            "      - {closing_mm: 3, relative: 0.1}\n      - {closing_mm: 3, relative: 0.1}"
        ),
        ["31: damage.uncertainty.repeatability[1].closing_mm: expected more than the closing before, got 3"],
    ),
    "section missing": (
        r"imaging:\n(  .*\n)+",
        "",
        ["1: imaging: expected a mapping with settle_s, frames_per_step, reference_frames, got nothing"],
    ),
}


@pytest.mark.parametrize(("old", "new", "expected"), BAD.values(), ids=BAD)
def test_a_bad_recipe_is_refused_with_line_field_and_expectation(small, write, old, new, expected):
    text, count = re.subn(old, new, small, count=1)
    assert count == 1
    path = write(text)
    with pytest.raises(SettingsError) as caught:
        load_recipe(path)
    assert str(caught.value).splitlines() == [f"{path}:{each}" for each in expected]


GOOD = {
    "steps up to the limit": (r"8\.5", "8"),
    "steps up to shut": (r"start: onset", "start: width\n  start_width_mm: 8"),
    "areas equal": (r"area_mm2: 150", "area_mm2: 100"),
    "just room above the least area": (r"area_mm2: 100", "area_mm2: 100\n      least_area_mm2: 84.7"),
    "early stop at the thresholds": (
        r"area_mm2: 160\n  growth_mm2_per_mm: 40",
        "area_mm2: 150\n  growth_mm2_per_mm: 30",
    ),
    "while closing": (r"start: onset", "start: onset\n  measured: while_closing"),
}


@pytest.mark.parametrize(("old", "new"), GOOD.values(), ids=GOOD)
def test_a_recipe_at_its_bounds_is_good(small, write, old, new):
    text, count = re.subn(old, new, small, count=1)
    assert count == 1
    assert load_recipe(write(text)).name == "cherry"


SIZE = """\
  size:
    from: class
    reference_mm: 35
    exponent: 2
    expected_length:
      smallest_mm: 25
      largest_mm: 45
    expected_ratio:
      smallest: 1
      largest: 2
    uncertainty_mm: 0.6
    classes:
      - {number: 1, smallest_mm: 20, largest_mm: 30}
      - {number: 2, smallest_mm: 40, largest_mm: 50}
    spread: 0.1
early_stop:
"""


@pytest.fixture(scope="session")
def sized(small):
    """A good recipe whose limits follow the fruit's size."""
    return small.replace("early_stop:\n", SIZE)


@pytest.mark.parametrize(("old", "new"), [("35", "35"), ("35", "25"), ("35", "45"), ("class\n", "length\n")])
def test_limits_follow_the_size_within_the_expected_lengths(sized, write, old, new):
    text = sized.replace(old, new, 1)
    recipe = load_recipe(write(text))
    assert recipe.damage.size
    assert [each.middle_mm for each in recipe.damage.size.classes] == [25, 45]
    assert Recipe.model_validate_json(recipe.model_dump_json()) == recipe


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("reference_mm: 35", "reference_mm: 24.9", "reference_mm: expected within expected_length"),
        ("reference_mm: 35", "reference_mm: 45.1", "reference_mm: expected within expected_length"),
        ("smallest_mm: 25", "smallest_mm: 45", "expected_length.smallest_mm: expected less than largest_mm, 45 mm"),
        ("smallest: 1", "smallest: 2", "expected_ratio.smallest: expected less than largest, 2,"),
        ("smallest_mm: 20", "smallest_mm: 19.9", "classes[0].smallest_mm: expected"),
        ("largest_mm: 50", "largest_mm: 50.1", "classes[1].smallest_mm: expected"),
        ("number: 2", "number: 1", "classes[1].number: expected"),
        ("smallest_mm: 40", "smallest_mm: 50", "classes[1].smallest_mm: expected less than largest_mm, 50 mm"),
        (SIZE[SIZE.index("    classes") : SIZE.index("    spread")], "", "classes: expected"),
    ],
)
def test_sizes_that_contradict_each_other_are_refused(sized, write, old, new, expected):
    assert sized.count(old)
    head, _, tail = sized.rpartition(old)
    with pytest.raises(SettingsError) as caught:
        load_recipe(write(head + new + tail))
    (line,) = str(caught.value).splitlines()
    assert f" damage.size.{expected}" in line


@pytest.mark.parametrize(
    ("decided_by", "deciding_mm", "passing_mm"),
    [("every_limit", 8, 8), ("first_trusted", 4, 4), ("every_trusted", 4, 8)],
)
def test_the_limits_that_decide(small, write, decided_by, deciding_mm, passing_mm):
    damage = load_recipe(write(small.replace("damage:\n", f"damage:\n  decided_by: {decided_by}\n"))).damage
    assert (damage.deciding_closing_mm, damage.passing_closing_mm) == (deciding_mm, passing_mm)
    last = damage.area[-1].model_copy(update={"closing_mm": 9.0})
    three = damage.model_copy(update={"area": (*damage.area, last)})
    first_mm = damage.area[0].closing_mm
    assert three.deciding_closing_mm == (9.0 if decided_by == "every_limit" else first_mm)
    assert three.passing_closing_mm == (first_mm if decided_by == "first_trusted" else 9.0)


def test_the_guard_band_has_the_coverage_of_a_normal_distribution(small, write):
    assert load_recipe(write(small)).damage.uncertainty.factor == pytest.approx(1.6449, abs=1e-4)


def test_the_repeatability_is_interpolated_and_held_beyond_its_ends():
    measured = (Repeatability(closing_mm=2.0, relative=0.1), Repeatability(closing_mm=4.0, relative=0.06))
    longer = (*measured, Repeatability(closing_mm=6.0, relative=0.02))
    for repeatability, expected in {
        measured: {1: 0.1, 2: 0.1, 3: 0.08, 4: 0.06, 9: 0.06},
        longer: {1: 0.1, 5: 0.04, 9: 0.02},
        measured[:1]: {1: 0.1, 2: 0.1, 9: 0.1},
    }.items():
        uncertainty = AreaUncertainty(repeatability=repeatability)
        found = [uncertainty.repeatability_at(closing) for closing in expected]
        assert found == pytest.approx([*expected.values()])


@pytest.mark.parametrize(("least_mm2", "passing"), [(70, False), (66.2, False), (66.1, True)])
def test_a_limit_with_no_room_above_its_least_area_is_refused_since_no_raspberry_passes(
    write, root, least_mm2, passing
):
    """A fruit in the middle of the room, its press without any uncertainty but the repeatability."""
    text = (root / "recipes" / "raspberry.yaml").read_text(encoding="utf-8")
    path = write(text.replace("least_area_mm2: 31", f"least_area_mm2: {least_mm2}"))
    shipped, area_mm2 = load_recipes()["raspberry"], 72.07
    limit = shipped.damage.area[0].model_copy(update={"least_area_mm2": least_mm2})
    recipe = shipped.model_copy(update={"damage": shipped.damage.model_copy(update={"area": (limit,), "size": None})})
    points = tuple(Measured(float(at), area_mm2 * at / 3, round(1000 * at), 0.9) for at in range(4))
    assert (judge(Press(24.0, 0.0, points), recipe).outcome == "PASS") == passing
    if passing:
        assert load_recipe(path).damage.area[0].least_area_mm2 == least_mm2
    else:
        with pytest.raises(SettingsError, match=r"damage\.area\[0\]\.least_area_mm2: expected room below"):
            load_recipe(path)


@pytest.mark.parametrize(
    ("decided_by", "without_room", "refused"),
    [
        ("every_limit", (), ()),
        ("every_limit", (0,), (0,)),
        ("every_limit", (1,), (1,)),
        ("every_limit", (0, 1), (0, 1)),
        ("every_trusted", (0,), ()),
        ("every_trusted", (1,), (1,)),
        ("every_trusted", (0, 1), (1,)),
        ("first_trusted", (0,), ()),
        ("first_trusted", (1,), ()),
        ("first_trusted", (0, 1), (0, 1)),
    ],
)
def test_limits_without_room_are_refused_where_by_the_judge_no_fruit_passes(
    small, write, decided_by, without_room, refused
):
    """Of fruit with straight curves, their presses without any uncertainty but the repeatability."""
    recipe, text = load_recipe(write(small)), small.replace("damage:\n", f"damage:\n  decided_by: {decided_by}\n")
    area = list(recipe.damage.area)
    for index in without_room:
        largest_mm2 = area[index].area_mm2
        area[index] = area[index].model_copy(update={"least_area_mm2": 0.9 * largest_mm2})
        line = f"      area_mm2: {largest_mm2:g}\n"
        text = text.replace(line, f"{line}      least_area_mm2: {0.9 * largest_mm2:g}\n")
    damage = recipe.damage.model_copy(update={"area": tuple(area), "decided_by": decided_by})
    recipe = recipe.model_copy(update={"damage": damage})
    curves = [
        tuple(Measured(float(at), slope * at / 4, round(1000 * at), 0.9) for at in range(9)) for slope in range(4, 120)
    ]
    passes = any(judge(Press(24.0, 0.0, points), recipe).outcome == "PASS" for points in curves)
    assert passes == (not refused)
    if refused:
        with pytest.raises(SettingsError) as caught:
            load_recipe(write(text))
        found = re.findall(r": damage\.area\[(\d)\]\.least_area_mm2: expected room below", str(caught.value))
        assert [int(index) for index in found] == list(refused)
    else:
        assert load_recipe(write(text)) == recipe


def test_what_a_recipe_does_not_say_is_left_out_of_its_values(small, write):
    """So that recipes of before these fields keep their content hash, and with it their approval."""
    values = load_recipe(write(small)).model_dump()
    assert {"stop_when_decided", "measured"}.isdisjoint(values["steps"])
    assert {"decided_by", "size", "uncertainty"}.isdisjoint(values["damage"])
    assert "press" not in values
    text = small.replace("start: onset", "start: onset\n  measured: while_closing\n  stop_when_decided: true")
    text = text.replace("damage:\n", "press:\n  attempts: 2\ndamage:\n  decided_by: first_trusted\n")
    values = load_recipe(write(text)).model_dump()
    assert values["steps"]["measured"] == "while_closing"
    assert values["steps"]["stop_when_decided"] is True
    assert values["press"]["attempts"] == 2
    assert values["damage"]["decided_by"] == "first_trusted"


def test_of_very_many_problems_the_first_fifty_are_told(small, write):
    with pytest.raises(SettingsError) as caught:
        load_recipe(write(small + "".join(f"key_{number}: 1\n" for number in range(3000))))
    assert len(caught.value.problems) == 51
    assert caught.value.problems[-1].expected == messages.MORE()


@pytest.mark.parametrize("content", ["", "[]", "7", "text"])
def test_what_is_no_mapping_is_no_recipe(write, content):
    with pytest.raises(SettingsError, match=r"r\.yaml:1: file: expected a mapping with schema_version, name, "):
        load_recipe(write(content))


def test_a_good_recipe_is_read_and_cannot_be_changed(small, write):
    recipe = load_recipe(write(small))
    assert (recipe.name, recipe.steps.travel_mm, recipe.segmentation.method) == ("cherry", 8.0, "robust")
    assert [threshold.area_mm2 for threshold in recipe.damage.area] == [100.0, 150.0]
    with pytest.raises(ValueError, match="frozen"):
        recipe.name = "other"  # pyrefly: ignore[read-only] (as is tested)


def test_steps_that_are_no_binary_fractions_end_where_a_person_says(small, write):
    text = small.replace("step_mm: 1", "step_mm: 1.1").replace("number: 8", "number: 3").replace("8.5", "3.3")
    text = text.replace("[4, 8]", "[1.1, 3.3]").replace("closing_mm: 4", "closing_mm: 1.1")
    assert load_recipe(write(text.replace("closing_mm: 8", "closing_mm: 3.3"))).steps.travel_mm == 3.3


class TestShipped:
    def test_the_four_are_there_with_their_own_numbers(self):
        recipes = load_recipes()
        assert sorted(recipes) == ["blueberry", "raspberry", "rubber_ball", "strawberry"]
        assert recipes["strawberry"].steps.result_closings_mm == (1.9, 3, 4, 8, 12)
        assert recipes["blueberry"].steps.result_closings_mm == (3, 8, 12, 16)
        assert recipes["raspberry"].steps.result_closings_mm == (3, 8, 12, 16)
        ball = recipes["rubber_ball"].steps
        assert (ball.start_width_mm, ball.step_mm, ball.number) == (46, 1, 13)

    def test_every_number_has_a_comment_near_it(self, root: Path):
        for path in (root / "recipes").glob("*.yaml"):
            lines = path.read_text().splitlines()
            assert lines[0] == "# yaml-language-server: $schema=recipe.schema.json"
            block_has_comment = False
            for line in lines:
                if not line.strip() or re.fullmatch(r"[a-z_]+:", line):
                    block_has_comment = block_has_comment and bool(line.strip())
                block_has_comment |= "#" in line
                if re.search(r": \[?[\d.]", line) and "schema_version" not in line:
                    assert block_has_comment, f"{path.name}: {line}"

    def test_the_papers_parameters_are_written_out_and_as_printed(self, root: Path):
        for recipe in load_recipes().values():
            assert recipe.segmentation.paper.model_fields_set == set(type(recipe.segmentation.paper).model_fields)
            assert recipe.segmentation.paper == type(recipe.segmentation.paper)()


class TestApprovedByTheDistribution:
    def test_each_shipped_recipe_by_the_hash_of_its_content(self, root):
        approved = approved_by_distribution()
        assert approved == json.loads((root / "recipes" / "approved.json").read_text())
        assert approved == {name: content_sha256(recipe) for name, recipe in load_recipes().items()}

    @pytest.mark.parametrize("content", [None, "", "{", "[]", "7"])
    def test_none_without_a_list_that_can_be_read(self, tmp_path, monkeypatch, content):
        if content is not None:
            (tmp_path / "approved.json").write_text(content)
        monkeypatch.setattr("station.settings.recipe.shipped_folder", lambda: tmp_path)
        assert approved_by_distribution() == {}


class TestFolders:
    def test_two_with_one_name_or_number_are_refused_and_both_named(self, small, write, tmp_path):
        first, second = write(small, "a.yaml"), write(small, "b.yml")
        with pytest.raises(SettingsError) as caught:
            load_recipes(tmp_path)
        assert str(caught.value).splitlines() == [
            f"{second}:2: name: expected one recipe with cherry, but {first} has it too",
            f"{second}:4: plc_number: expected one recipe with 7, but {first} has it too",
        ]

    def test_neither_of_two_that_clash_can_be_found_but_a_third_can(self, small, write, tmp_path):
        write(small, "a.yaml")
        write(small.replace("plc_number: 7", "plc_number: 8"), "b.yaml")
        write(small.replace("cherry", "plum").replace("plc_number: 7", "plc_number: 9"), "c.yaml")
        assert find_recipe("plum", tmp_path).plc_number == 9
        with pytest.raises(BadInputError, match=r"one of plum \(in .*\)\n.*b\.yaml:2: name: expected one recipe with"):
            find_recipe("cherry", tmp_path)

    def test_all_files_problems_come_at_once(self, small, write, tmp_path):
        first = write(small.replace("force_n: 20", "force_n: 0"), "a.yaml")
        second = write("- 1", "b.yaml")
        with pytest.raises(SettingsError) as caught:
            load_recipes(tmp_path)
        assert [str(problem.place) for problem in caught.value.problems] == [f"{first}:16", f"{second}:1"]

    def test_the_list_of_hashes_is_in_the_order_of_the_names(self, small, write, tmp_path):
        write(small, "a.yaml")
        write(small.replace("cherry", "apricot").replace("plc_number: 7", "plc_number: 9"), "b.yaml")
        assert list(json.loads(approved_list(tmp_path))) == ["apricot", "cherry"]

    def test_other_files_are_left_alone(self, small, write, tmp_path):
        write(small)
        write("{}", "recipe.schema.json")
        write("no: [", ".hidden.yaml")
        assert list(load_recipes(tmp_path)) == ["cherry"]

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            (".", "folder: expected recipes"),
            ("none", "folder: expected a folder of recipes: no such file or directory"),
            ("a\0b", "folder: expected a folder of recipes"),
        ],
    )
    def test_a_folder_without_recipes(self, tmp_path, name, message):
        with pytest.raises(SettingsError, match=message):
            load_recipes(tmp_path / name)


class TestFinding:
    def test_by_name_and_by_path(self, small, write, tmp_path, monkeypatch):
        path = write(small)
        assert find_recipe("strawberry").plc_number == 1
        assert find_recipe("cherry", tmp_path) == find_recipe(path) == find_recipe(str(path)) == load_recipe(path)
        monkeypatch.chdir(tmp_path)
        assert find_recipe("r.yaml").name == "cherry"

    def test_an_unknown_name_lists_those_there_are(self):
        with pytest.raises(BadInputError) as caught:
            find_recipe("strawbery")
        assert str(caught.value).startswith(
            "recipe strawbery: did you mean strawberry? expected the path of a .yaml file or one of "
            "blueberry, raspberry, rubber_ball, strawberry (in "
        )

    def test_a_name_unlike_any_is_given_no_hint(self):
        with pytest.raises(
            BadInputError, match=r"^recipe zzz: expected the path of a \.yaml file or one of blueberry, "
        ):
            find_recipe("zzz")

    def test_what_holds_a_separator_is_a_path(self, small, write, tmp_path, monkeypatch):
        write(small, "plain")
        monkeypatch.chdir(tmp_path)
        assert find_recipe("./plain").name == "cherry"

    def test_a_broken_neighbour_does_no_harm_and_is_named_where_it_may_be_the_one(self, small, write, tmp_path):
        write(small)
        broken = write("name: plum", "plum.yaml")
        assert find_recipe("cherry", tmp_path).name == "cherry"
        with pytest.raises(SettingsError) as its_own:
            load_recipe(broken)
        with pytest.raises(BadInputError) as caught:
            find_recipe("plum", tmp_path)
        assert str(caught.value).splitlines()[1:] == str(its_own.value).splitlines()
        assert f"{broken}:1: schema_version: expected 1, got nothing" in str(caught.value)


def test_a_light_touch_and_a_count_are_as_the_judge_and_the_gripper_have_them():
    assert recipe_model._LIGHT_TOUCH == LIGHT_TOUCH
    assert GripperCalibration().mm_per_count / 2 + AT_MM <= recipe_model._AT_CLOSING_MM


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_by_every_recipe_that_is_accepted_a_fruit_can_pass(small, data):
    """A straight curve under the limits, each step up to half a count of the gripper further than commanded."""
    tenths = st.integers(1, 40)
    step_mm, closings = data.draw(st.integers(4, 20)) / 10, sorted(data.draw(st.sets(tenths, min_size=1, max_size=3)))
    values = parse_document(small.encode(), "f").value
    number = math.ceil(closings[-1] / 10 / step_mm)
    values["steps"] |= {
        "step_mm": step_mm,
        "number": number,
        "closing_limit_mm": 50,
        "result_closings_mm": [closing / 10 for closing in closings],
        "stop_when_decided": data.draw(st.booleans()),
    }
    values["damage"] = {
        "area": [{"closing_mm": closing / 10, "area_mm2": 200} for closing in closings],
        "decided_by": data.draw(st.sampled_from(["every_limit", "first_trusted", "every_trusted"])),
        "growth_mm2_per_mm": 500,
    }
    values["early_stop"] = {"area_mm2": 260, "growth_mm2_per_mm": 1000}
    try:
        recipe = Recipe.model_validate_json(json.dumps(values))
    except ValidationError:
        return
    further = st.floats(0, GripperCalibration().mm_per_count / 2)
    at_mm = [0.0, *(step * step_mm + data.draw(further) for step in range(1, number + 1))]
    points = tuple(Measured(each, 20 * each, round(20_000 * each), 0.9) for each in at_mm)
    press = Press(25.0, 0.0, points)
    for taken in range(1, len(points) + 1):
        press = replace(press, points=points[:taken])
        if early_stop(press, recipe) is not None:
            break
    assert judge(press, recipe).outcome == "PASS"


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(-(10**20), 10**20), st.floats(), st.text(max_size=8),
    st.sampled_from(["[]", "{}", "[1, 2]", "{a: 1}", "NO", "012", "*a", "&a 1", "!!set {}", "'", "1.5", "width"]),
)  # fmt: skip


@settings(
    max_examples=3 * settings().max_examples,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_a_mutated_recipe_is_a_recipe_or_a_list_of_problems(small, data):
    lines = small.splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        index = data.draw(st.integers(0, len(lines) - 1))
        key = lines[index].partition(":")[0]
        lines[index] = data.draw(
            st.sampled_from([f"{key}: {data.draw(VALUES)}", "", lines[0], key, f"  {lines[index]}", lines[index][2:]])
        )
    document = parse_document("\n".join(lines).encode("utf-8", "surrogatepass"), "f")
    found: tuple[Problem, ...] | Recipe
    try:
        found = validated(Recipe, document, document.value, document.locate)
    except SettingsError as error:
        found = error.problems
    if isinstance(found, Recipe):
        assert Recipe.model_validate_json(found.model_dump_json()) == found
    else:
        assert found
        assert all(re.match(r"f:\d+: \S+.*: ", str(problem)) for problem in found)


def test_a_recipe_survives_being_kept_beside_a_result(small, write):
    recipe = load_recipe(write(small))
    assert Recipe.model_validate_json(recipe.model_dump_json()) == recipe


def test_a_copied_folder_is_as_good_as_the_shipped_one(root, tmp_path):
    shutil.copytree(root / "recipes", tmp_path / "site")
    assert load_recipes(tmp_path / "site") == load_recipes()


@pytest.mark.parametrize(
    ("step_mm", "number", "closing_mm", "below_mm"),
    [
        (0.5, 8, 1.0, None),  # at the light touch's end
        (1.0 - 0.22, 8, 1.0, 0.78),  # as near to the closing as makes it one at it
        (0.1, 5, 1.0, None),  # the last step
        (0.1, 4, 1.0, 0.78),
        (1.4, 8, 3.0, 2.78),  # a light touch, and one beyond
        (1.4, 8, 2.8234567, 2.603457),
    ],
)
def test_a_limit_is_judged_on_one_step_unless_another_is_between_a_light_touch_and_its_closing(
    step_mm, number, closing_mm, below_mm
):
    recipe = load_recipes()["blueberry"]
    limit = recipe.damage.area[0].model_copy(update={"closing_mm": closing_mm})
    changed = recipe.model_copy(
        update={
            "steps": recipe.steps.model_copy(update={"step_mm": step_mm, "number": number}),
            "damage": recipe.damage.model_copy(update={"area": (limit,), "decided_by": "every_limit"}),
        }
    )
    found = [message.parameters["below_mm"] for _, message in changed._judged_on_one_step()]
    assert found == ([] if below_mm is None else [pytest.approx(below_mm, abs=1e-9)])
