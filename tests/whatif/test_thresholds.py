"""The threshold assistant: the limit of the least cost from fruit marked good and bad, and how unsure that is."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.inspection.fruit_size import FruitSize
from station.inspection.judge import judge
from station.inspection.press import Measured, Press
from station.settings.recipe import find_recipe, load_recipe
from station.settings.recipe_versions import content_sha256
from station.vocabulary import Flag, Reason
from station.whatif.limits import (
    Costs,
    MarkedFruit,
    at_reference,
    choose,
    cross_validated,
    errors,
    exponent_of,
    fewest_fruit,
    least_area_at,
    marked_fruit,
    rate_interval,
)
from station.whatif.proposal import Proposal, proposals_of
from station.whatif.threshold_draft import draft_recipe

AREAS = st.lists(st.floats(1, 200), min_size=1, max_size=60).map(np.array)
COSTS = Costs(false_accept=20, damaged_share=0.05)


def cost(good, bad, limit_mm2, costs=COSTS):
    (diverted,), (passed,) = errors(good, bad, np.array([limit_mm2]))
    return costs.of(passed / len(bad), diverted / len(good))


@settings(max_examples=60, deadline=None)
@given(AREAS, AREAS, st.floats(1, 201), st.floats(0.1, 100), st.floats(0.01, 0.5))
def test_no_limit_among_the_values_costs_less(good, bad, other, false_accept, share):
    costs = Costs(false_accept, share)
    chosen = choose(good, bad, costs)
    assert cost(good, bad, chosen, costs) <= cost(good, bad, max(other, min(good.min(), bad.min())), costs) + 1e-9


def test_between_kinds_that_do_not_overlap_the_limit_is_in_the_middle():
    assert choose(np.array([80.0, 100.0]), np.array([144.0, 150.0]), COSTS) == pytest.approx(120.0)


def test_a_dear_false_accept_lowers_the_limit_and_a_rare_one_raises_it():
    random = np.random.default_rng(1)
    good, bad = random.normal(100, 10, 400), random.normal(125, 10, 400)
    limits = [choose(good, bad, Costs(*each)) for each in ((20, 0.05), (200, 0.05), (20, 0.005))]
    assert limits[1] < limits[0] < limits[2]


def test_what_no_limit_passes_counts_as_diverted_and_never_as_passed():
    good, bad = np.array([80.0, math.inf]), np.array([math.inf, math.inf])
    assert [int(count[0]) for count in errors(good, bad, np.array([500.0]))] == [1, 0]
    assert choose(good, bad, COSTS) == 80.0


def test_on_fruit_left_out_the_errors_are_not_flattered():
    good, bad = np.array([80.0, 90.0, 131.0]), np.array([121.0, 140.0, 150.0])
    limit = choose(good, bad, Costs(1, 0.5))
    inside = sum(int(count[0]) for count in errors(good, bad, np.array([limit])))
    left_out = cross_validated(good, bad, Costs(1, 0.5))
    assert left_out is not None
    assert inside == 1 < sum(left_out)
    assert cross_validated(good, bad[:1], COSTS) is None


def test_the_errors_on_fruit_left_out_are_those_on_other_fruit_also_where_the_closing_was_chosen_by_chance():
    """At five closings of equal worth, whose areas are the same truth with noise of their own."""
    rule = find_recipe("strawberry").damage.size
    assert rule is not None

    def drawn(random, number):
        good = [each % 3 > 0 for each in range(number)]
        lengths = random.uniform(30, 60, number)
        truth = np.where(good, 100, 120) * (lengths / rule.reference_mm) ** rule.exponent
        fruit = {
            closing_mm: [
                MarkedFruit(is_good, area, area, length)
                for is_good, area, length in zip(good, truth * random.lognormal(0, 0.13, number), lengths, strict=True)
            ]
            for closing_mm in (1.0, 2.0, 3.0, 4.0, 5.0)
        }
        return fruit, good

    left_out_costs, compared, on_others = [], [], []
    for seed in range(16):
        random = np.random.default_rng(seed)
        best = proposals_of(*drawn(random, 24), rule, COSTS)[0]
        assert best.left_out is not None
        diverted, of_good, passed, of_bad = best.left_out
        left_out_costs.append(COSTS.of(passed / of_bad, diverted / of_good))
        compared.append(best.cost(COSTS))
        others = at_reference(drawn(random, 3000)[0][best.closing_mm], best.exponent, rule.reference_mm)
        on_others.append(cost(*others, best.limit_mm2))
    standard_error = np.std(left_out_costs) / math.sqrt(len(left_out_costs))
    assert np.mean(left_out_costs) > np.mean(on_others) - standard_error
    assert np.mean(compared) < np.mean(on_others) - 2 * standard_error, "by the closing's own limits it is less"


def test_a_fruit_without_a_constraint_at_the_closing_of_the_others_is_not_counted_among_those_left_out():
    areas = [80.0, 85.0, 90.0, 95.0, *(80.0 + each for each in range(16)), 130.0, 140.0, 150.0]
    good = [True] * 20 + [False] * 3
    fruit = [MarkedFruit(is_good, area, area, None) for is_good, area in zip(good, areas, strict=True)]
    (best,) = proposals_of({3.0: [None, *fruit[1:-1], None]}, good, None, COSTS)
    assert best.left_out == (0, 19, 0, 2)
    assert proposals_of({3.0: fruit[:21]}, good[:21], None, COSTS)[0].left_out is None


def test_the_exponent_is_found_within_the_kinds():
    random = np.random.default_rng(2)
    lengths = random.uniform(35, 60, 40)
    fruit = [
        MarkedFruit(number % 2 == 0, 0.0, (2.0 + 1.5 * (number % 2)) * length**0.8 * random.normal(1, 0.02), length)
        for number, length in enumerate(lengths)
    ]
    found = exponent_of(fruit)
    assert found is not None
    assert found.value == pytest.approx(0.8, abs=3 * found.standard_error)
    assert 0.005 < found.standard_error < 0.05
    assert exponent_of([MarkedFruit(True, 0.0, 100.0, None)] * 9) is None
    assert exponent_of([MarkedFruit(True, 0.0, 100.0, 45.0)] * 9) is None


def test_the_exponent_is_not_fitted_to_areas_that_the_judge_does_not_trust():
    """Of the fruit over 50 mm the border cuts a fifth off."""
    random = np.random.default_rng(1)
    fruit = []
    for number, length_mm in enumerate(random.uniform(30, 62, 40)):
        area_mm2 = 4.5 * length_mm**0.78 * random.normal(1, 0.09)
        one = MarkedFruit(number % 2 == 0, 1.2 * area_mm2, area_mm2, length_mm)
        fruit.append(replace(one, passes_from_mm2=math.inf, area_mm2=0.8 * area_mm2) if length_mm > 50 else one)
    found = exponent_of(fruit)
    assert found is not None
    assert found.fruit == sum(math.isfinite(one.passes_from_mm2) for one in fruit) < 35
    assert found.value == pytest.approx(0.78, abs=2 * found.standard_error)
    fooled = exponent_of([replace(one, passes_from_mm2=0.0) for one in fruit])
    assert fooled is not None
    assert fooled.value < 0.78 - 4 * fooled.standard_error


def test_fruit_are_compared_at_the_reference_length():
    fruit = [MarkedFruit(True, 100.0, 90.0, 40.0), MarkedFruit(False, 100.0, 90.0, None)]
    good, bad = at_reference(fruit, 0.5, 90.0)
    assert (good.tolist(), bad.tolist()) == ([150.0], [100.0])


class TestWhatAPressSays:
    RECIPE = find_recipe("strawberry")

    def press(self, areas_mm2=(8.0, 50.0, 70.0, 90.0), *interruptions, flags=()):
        closings = (0.0, 1.12, 1.87, 3.0)[: len(areas_mm2)]
        points = tuple(
            Measured(closing_mm, area_mm2, round(area_mm2 * 1400), 0.9, frozenset(flags if closing_mm > 1.5 else ()))
            for closing_mm, area_mm2 in zip(closings, areas_mm2, strict=True)
        )
        return Press(35.0, 0.2, points, interruptions, FruitSize(length_mm=45.4))

    @pytest.mark.parametrize(
        ("limit", "areas_mm2", "area_mm2"),
        [(1, (8.0, 50.0, 70.0, 90.0), 90.0), (0, (8.0, 33.6, 56.0, 92.0), pytest.approx(56.0, abs=1.0))],
        ids=["3 mm", "1.9 mm"],
    )
    def test_the_least_limit_is_where_the_judge_begins_to_pass_it(self, limit, areas_mm2, area_mm2):
        press, threshold = self.press(areas_mm2), self.RECIPE.damage.area[limit]
        one = marked_fruit(press, self.RECIPE, threshold.closing_mm, good=True, draft=self.RECIPE)
        assert one is not None
        assert one.area_mm2 == area_mm2
        assert one.length_mm == 45.4

        def by(limit_mm2):
            area = (threshold.model_copy(update={"area_mm2": limit_mm2}),)
            damage = self.RECIPE.damage.model_copy(update={"area": area})
            return judge(press, self.RECIPE.model_copy(update={"damage": damage})).outcome

        assert by(one.passes_from_mm2 + 0.01) == "PASS"
        assert by(one.passes_from_mm2 - 0.01) != "PASS"

    def test_the_least_area_goes_with_the_closing_from_limit_to_limit(self):
        closings = (0.95, 1.9, 2.45, 3.0, 12.0)
        assert [least_area_at(self.RECIPE, each) for each in closings] == pytest.approx([12.5, 25.0, 38.5, 52.0, 52.0])

    def test_a_limit_is_by_the_drafts_size_rule_and_guard_band_whatever_the_revision_had(self, changed):
        sizeless = changed(self.RECIPE, damage__size=None)
        loose = changed(sizeless, damage__uncertainty__coverage=0.5)
        found = [marked_fruit(self.press(), own, 3.0, good=True, draft=self.RECIPE) for own in (self.RECIPE, loose)]
        assert found[0] == found[1]
        assert found[0] != marked_fruit(self.press(), self.RECIPE, 3.0, good=True, draft=loose)

    def test_a_limit_that_no_recipe_may_have_is_none(self):
        """Of a small fruit's large area: for a fruit of the reference length it is beyond the range of a recipe."""
        press = replace(self.press((8.0, 60.0, 100.0, 150.0)), onset_mm=22.0, size=FruitSize(length_mm=21.0))
        one = marked_fruit(press, self.RECIPE, 3.0, good=True, draft=self.RECIPE)
        assert one is not None
        assert math.isinf(one.passes_from_mm2)

    def test_what_the_judge_doubts_passes_by_no_limit(self):
        one = marked_fruit(self.press(flags=(Flag.CUT_BY_BORDER,)), self.RECIPE, 3.0, good=True, draft=self.RECIPE)
        assert one is not None
        assert math.isinf(one.passes_from_mm2)

    def test_a_bad_fruit_that_was_stopped_before_has_at_least_its_area(self):
        stopped = self.press((8.0, 110.0, 160.0))
        damage = self.RECIPE.damage.model_copy(update={"area": self.RECIPE.damage.area[-1:], "growth_mm2_per_mm": 500})
        one_limit = self.RECIPE.model_copy(update={"damage": damage})
        bad = marked_fruit(stopped, self.RECIPE, 3.0, good=False, draft=one_limit)
        assert bad is not None
        assert (bad.passes_from_mm2, bad.at_least) == (160.0, True)
        fails = marked_fruit(stopped, self.RECIPE, 3.0, good=False, draft=self.RECIPE)
        assert fails is not None
        assert (fails.passes_from_mm2, fails.at_least) == (math.inf, False), "by the limit at 1.9 mm, not exceeded"
        good = marked_fruit(stopped, self.RECIPE, 3.0, good=True, draft=self.RECIPE)
        assert good is not None
        assert math.isinf(good.passes_from_mm2)

    @pytest.mark.parametrize("stops", [True, False])
    @pytest.mark.parametrize("by", ["every_trusted", "every_limit"])
    def test_a_bad_fruit_that_an_earlier_limit_lets_pass_no_more_is_passed_by_no_later_limit(self, changed, stops, by):
        """It grows by 47 mm² per mm, and is stopped at 1.9 mm, too near the limit there to pass."""
        press = self.press((8.0, 47 * 1.12, 47 * 1.87))
        verdict = judge(press, self.RECIPE)
        assert (verdict.outcome, verdict.reasons) == ("NO_RESULT", (Reason.NEAR_LIMIT,))
        assert verdict.stopped is not None
        assert verdict.stopped.finding is None
        draft = changed(self.RECIPE, steps__stop_when_decided=stops, damage__decided_by=by)
        bad = marked_fruit(press, self.RECIPE, 3.0, good=False, draft=draft)
        assert bad is not None
        assert (bad.passes_from_mm2, bad.at_least) == (math.inf, False)

    def test_a_fault_says_nothing_of_the_fruit(self):
        assert (
            marked_fruit(self.press((8.0, 50.0), Reason.CAMERA_FAULT), self.RECIPE, 3.0, good=False, draft=self.RECIPE)
            is None
        )
        assert marked_fruit(Press(None, 0.0, ()), self.RECIPE, 3.0, good=True, draft=self.RECIPE) is None


def test_a_rate_of_none_seen_is_not_nought():
    interval = rate_interval(0, 50)
    assert interval.low == 0
    assert interval.high == pytest.approx(0.0711, abs=0.0005), "1 - 0.025 ** (1 / 50)"
    assert rate_interval(0, fewest_fruit(0.01)).high == pytest.approx(0.01, abs=0.0001)


def test_a_limit_is_proposed_from_marked_fruit_and_written_as_a_draft(orchard, draft, station, tmp_path):
    growths = [25 + number / 10 for number in range(40)] + [40.0 + number for number in range(5)]
    made = orchard.store([orchard.press(growth, seed=number) for number, growth in enumerate(growths)])
    marks = tmp_path / "marks.csv"
    words = ["good"] * 40 + ["bad"] * 5
    rows = "".join(f"{sequence},{word}\n" for sequence, word in zip(made, words, strict=True))
    marks.write_text("sequence,mark\n" + rows + "9999,good\n")
    out, file = tmp_path / "out", tmp_path / "proposed.yaml"
    arguments = ("thresholds", "--recipe", "strawberry", "--marks", marks, "--out", out, "--draft", file)
    code, output = station(*arguments)
    assert code == 0
    assert "368 to show that at most 1 % pass" in output
    figures = json.loads((out / "thresholds.json").read_text())
    best = figures["proposed"]
    assert best["closing_mm"] == 3
    assert (best["good_diverted"]["of"], best["bad_passed"]["of"]) == (40, 5)
    assert (best["good_diverted"]["count"], best["bad_passed"]["count"]) == (0, 0)
    assert best["left_out"]["bad_passed"]["interval"][1] > 0.5, "five bad fruit show little"
    guard = 1 + judge(orchard.press(28), orchard.recipe).budget.expanded
    assert 3 * 29 * guard < best["limit_mm2"] < 3 * 40 * guard
    proposed = load_recipe(file)
    assert proposed.damage.area[0].area_mm2 == pytest.approx(best["limit_mm2"], abs=0.05)
    assert proposed.early_stop.area_mm2 >= proposed.damage.area[0].area_mm2
    assert "# the paper" in file.read_text(), "comments remain"
    rates = figures["by_the_proposed_recipe"]
    assert (rates["bad"]["rejected"], rates["good"]["rejected"]) == (5, 0)
    page = (out / "thresholds.html").read_text()
    assert page.count("data:image/png") == 2
    slider_curve = json.loads(page.split("const curve = ")[1].split(", slider = ")[0])
    assert slider_curve == best["curve"]
    assert "http" not in page, "it needs no network"
    again = ("thresholds", "--recipe", "strawberry", "--out", tmp_path / "again")
    code, output = station(*again)
    assert (code, "no fruit is marked" in output) == (2, True)
    for word, some in (("good", made[:40]), ("bad", made[40:])):
        assert station("records", "mark", *some, word)[0] == 0
    assert station(*again)[0] == 0
    assert json.loads((tmp_path / "again" / "thresholds.json").read_text()) == figures, "as from the table"


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"imaging__settle_s": 0.5}, "their revision pressed otherwise (imaging)"),
        ({"segmentation__robust__gate_ratio": 4.0}, "their revision measured otherwise"),
    ],
)
def test_marked_fruit_of_a_revision_that_pressed_or_measured_otherwise_are_left_out(
    orchard, station, changed, tmp_path, changes, why
):
    """By the other revision the areas are larger: of its fruit alone the limit would be another."""
    other = replace(orchard, recipe=changed(orchard.recipe, **changes))

    def figures(name: str) -> tuple[dict[str, object], str]:
        code, output = station("thresholds", "--recipe", "strawberry", "--out", tmp_path / name)
        assert code == 0, output
        return json.loads((tmp_path / name / "thresholds.json").read_text()), output

    def store_and_mark(orchard, good: list[float], bad: list[float]) -> None:
        made = orchard.store([orchard.press(growth, seed=number) for number, growth in enumerate([*good, *bad])])
        for word, some in (("good", made[: len(good)]), ("bad", made[len(good) :])):
            assert station("records", "mark", *some, word)[0] == 0

    store_and_mark(other, [29 + number / 4 for number in range(12)], [44.0, 45.0, 46.0])
    code, output = station("thresholds", "--recipe", "strawberry", "--out", tmp_path / "none")
    assert (code, f"15 marked fruit are left out: {why}" in output) == (2, True), output
    store_and_mark(orchard, [25 + number / 4 for number in range(12)], [40.0, 41.0, 42.0])
    both, output = figures("both")
    assert f"15 marked fruit left out: {why}" in output
    assert both.pop("of_other_revisions") == {why: 15}
    for sequence in range(1, 16):
        assert station("records", "mark", sequence, "none")[0] == 0
    alone, output = figures("alone")
    assert "left out:" not in output
    assert alone.pop("of_other_revisions") == {}
    assert both == alone


@pytest.mark.parametrize(
    ("decided_by", "drafted"), [("every_trusted", "every_trusted"), ("first_trusted", "every_limit")]
)
def test_the_proposed_limit_decides_on_every_fruit(
    orchard, station, changed, tmp_path, monkeypatch, decided_by, drafted
):
    recipe = changed(find_recipe("strawberry"), damage__decided_by=decided_by)
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "strawberry.yaml").write_text(recipe.model_dump_json())
    monkeypatch.setenv("STATION_RECIPES_FOLDER", str(tmp_path / "site"))

    def at_3_mm(number: int, area_mm2: float) -> Press:
        """Until then good and bad fruit are alike."""
        areas_mm2 = (4.0, 28.0, 50.0 + number % 10, area_mm2)
        points = (Measured(float(step), each, round(each * 1100), 0.9) for step, each in enumerate(areas_mm2))
        return Press(35.0, 0.4, tuple(points))

    good = [at_3_mm(number, 80.0 + number % 7) for number in range(30)]
    bad = [at_3_mm(number, 104.0 + number % 3) for number in range(10)]
    made = replace(orchard, recipe=recipe).store([*good, *bad])
    for word, some in (("good", made[:30]), ("bad", made[30:])):
        assert station("records", "mark", *some, word)[0] == 0
    file = tmp_path / "proposed.yaml"
    code, output = station("thresholds", "--recipe", "strawberry", "--out", tmp_path / "out", "--draft", file)
    assert (code, "mm² at 3 mm" in output) == (0, True), output
    damage = load_recipe(file).damage
    assert (damage.decided_by, len(damage.area)) == (drafted, 2)
    assert damage.area[1].area_mm2 < 130
    code, output = station("recipes", "import", file, "--who", "Ida", "--reason", "marked fruit")
    assert code == 0, output
    assert load_recipe(tmp_path / "site" / "strawberry.yaml").damage == damage
    code, output = station("recipes", "import", file, "--who", "Ida", "--reason", "again")
    assert (code, "it was changed since" in output) == (1, True), output


def test_no_comment_of_the_draft_is_of_a_value_before(orchard, station, tmp_path, monkeypatch):
    """A limit above the early stop, at another closing, with another exponent: each line names its source."""
    shipped = find_recipe("raspberry")
    early, (area,) = shipped.early_stop, shipped.damage.area
    stop = early.model_copy(update={"area_mm2": 62.0})
    damage = shipped.damage.model_copy(update={"area": (area.model_copy(update={"area_mm2": 60.0}),)})
    pressed_by = shipped.model_copy(update={"damage": damage, "early_stop": stop})
    (tmp_path / "site").mkdir()
    file = tmp_path / "site" / "raspberry.yaml"
    text = (Path(__file__).parents[2] / "recipes" / "raspberry.yaml").read_text()
    text = text.replace("area_mm2: 78 ", "area_mm2: 60 ").replace("area_mm2: 81 ", "area_mm2: 62 ")
    file.write_text(text)
    assert find_recipe("raspberry", tmp_path / "site") == pressed_by
    monkeypatch.setenv("STATION_RECIPES_FOLDER", str(tmp_path / "site"))
    random = np.random.default_rng(5)

    def press(level: float) -> Press:
        length_mm = round(random.uniform(18, 30), 1)
        area_mm2 = level * (length_mm / 24) ** 2
        areas = ((0.0, 4.0), (1.0, area_mm2 / 3), (2.0, 2 * area_mm2 / 3), (3.0, area_mm2))
        points = tuple(Measured(closing, each, round(each * 1100), 0.9) for closing, each in areas)
        return Press(24.0, 0.1, points, (), FruitSize(length_mm))

    made = replace(orchard, recipe=pressed_by).store([*(press(60) for _ in range(20)), *(press(90) for _ in range(8))])
    for word, some in (("good", made[:20]), ("bad", made[20:])):
        assert station("records", "mark", *some, word)[0] == 0
    proposed = tmp_path / "proposed.yaml"
    code, output = station("thresholds", "--recipe", "raspberry", "--out", tmp_path / "out", "--draft", proposed)
    assert code == 0, output
    base, _, drafted = proposed.read_text().partition("\n")
    assert base == f"# base: sha256 {content_sha256(pressed_by)}"
    before, after = (each.replace("  #", " #").splitlines() for each in (text, drafted))
    marked = "`station thresholds`: 20 good and 8 bad fruit"
    changed = [new for old, new in zip(before, after, strict=True) if old != new]
    recipe = load_recipe(proposed)
    assert recipe.damage.size is not None
    assert [" ".join(line.split()) for line in changed] == [
        f"area_mm2: {recipe.damage.area[0].area_mm2} # of a fruit of the reference length; {marked}",
        f"exponent: {recipe.damage.size.exponent} # regression over these fruit; {marked}",
        f"area_mm2: {recipe.early_stop.area_mm2} # the last limit",
    ]


def test_a_limit_at_another_closing_has_the_least_area_of_there(orchard, station, tmp_path, monkeypatch):
    """Good and bad fruit differ at 1.5 mm, where both show less than the least area at 3 mm, and are alike at 3 mm."""
    (tmp_path / "site").mkdir()
    file = tmp_path / "site" / "raspberry.yaml"
    shipped = (Path(__file__).parents[2] / "recipes" / "raspberry.yaml").read_text()
    file.write_text(shipped.replace("result_closings_mm: [3,", "result_closings_mm: [1.5, 3,"))
    monkeypatch.setenv("STATION_RECIPES_FOLDER", str(tmp_path / "site"))

    def press(number: int, area_mm2: float) -> Press:
        areas = ((0.0, 2.0), (0.75, area_mm2 / 2), (1.5, area_mm2), (2.25, 46.0), (3.0, 60.0 + number % 5))
        return Press(24.0, 0.1, tuple(Measured(closing, each, round(each * 1100), 0.9) for closing, each in areas))

    good = [press(number, 20.0 + number % 4) for number in range(20)]
    bad = [press(number, 38.0 + number % 3) for number in range(8)]
    made = replace(orchard, recipe=load_recipe(file)).store([*good, *bad])
    for word, some in (("good", made[:20]), ("bad", made[20:])):
        assert station("records", "mark", *some, word)[0] == 0
    proposed = tmp_path / "proposed.yaml"
    code, output = station("thresholds", "--recipe", "raspberry", "--out", tmp_path / "out", "--draft", proposed)
    assert (code, "mm² at 1.5 mm" in output) == (0, True), output
    assert "good fruit diverted by the proposed recipe: 0 of 20" in output
    (area,) = load_recipe(proposed).damage.area
    assert (area.closing_mm, area.least_area_mm2) == (1.5, 15.5)
    assert 23 < area.area_mm2 < 38


@pytest.mark.parametrize(
    ("closing_mm", "closings_mm"),
    [
        (0.5, [0.5, 2, 3, 4]),
        (1.5, [1, 1.5, 3, 4]),
        (2.5, [1, 2, 2.5, 4]),
        (3, [1, 2, 3, 4]),
        (3.5, [1, 2, 3, 3.5]),
        (5, [1, 2, 3, 5]),
    ],
)
def test_a_draft_of_several_limits_has_the_proposed_one_in_its_order(changed, tmp_path, closing_mm, closings_mm):
    recipe = find_recipe("strawberry")
    first = recipe.damage.area[0]
    limits = [first.model_copy(update={"closing_mm": mm, "area_mm2": 60.0 + 10 * mm}) for mm in (1.0, 2.0, 3.0, 4.0)]
    recipe = changed(
        recipe,
        steps__result_closings_mm=[0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4, 5],
        damage__area=[each.model_dump() for each in limits],
        damage__decided_by="every_limit",
        early_stop__area_mm2=150.0,
    )
    (tmp_path / "strawberry.yaml").write_text(recipe.model_dump_json())
    (tmp_path / "blueberry.yaml").write_text("half written: [")
    assert recipe.damage.size is not None
    exponent, limit_mm2 = recipe.damage.size.exponent, 61.0 + 10 * closing_mm
    best = Proposal(closing_mm, (), 0, exponent, None, np.ones(3), np.ones(3), limit_mm2, None)
    drafted, _ = draft_recipe(recipe, best, "strawberry", tmp_path)
    assert [each.closing_mm for each in drafted.damage.area] == closings_mm
    areas_mm2 = {each.closing_mm: each.area_mm2 for each in drafted.damage.area}
    assert areas_mm2[closing_mm] == limit_mm2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a,b\n", ":1: expected the header sequence,mark"),
        ("sequence,mark\n1,fine\n", ":2: mark: expected good or bad, got 'fine'"),
        ("sequence,mark\nx,good\n", ":2: sequence: expected an inspection's number"),
        ("sequence,mark\n1,good\n1,bad\n", ":3: 1 is marked good and bad"),
        ("sequence,mark\n1,bad\n", "none of the fruit marked good"),
        ("sequence,mark\n1,good\n", "none of the fruit marked bad"),
        ("\x00", "expected"),
    ],
)
def test_bad_marks_are_told(orchard, station, tmp_path, content, message):
    orchard.store([orchard.press(27.0)])
    marks = tmp_path / "marks.csv"
    marks.write_text(content)
    code, output = station("thresholds", "--recipe", "strawberry", "--marks", marks, "--out", tmp_path / "out")
    assert code == 2
    assert message in output
