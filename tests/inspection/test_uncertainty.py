"""The budget of uncertainty: its components, how they add, and the guard band that follows."""

from dataclasses import replace
from math import hypot, sqrt

import numpy as np
import pytest

from station.inspection.fruit_size import FruitSize
from station.inspection.judge import judge
from station.inspection.press import Measured, Press
from station.inspection.uncertainty import COMPONENTS
from station.vocabulary import Reason
from tests.inspection.test_sized_limits import RECIPE, recipe_with

FRUIT = Press(
    35.0,
    0.4,
    tuple(Measured(float(c), 30.0 * c, 1000 * c, 0.9) for c in range(4)),
    size=FruitSize(40.0),
    resolution_mm=0.38,
    scale_uncertainty=0.0125,
)


def test_the_budget_of_a_press():
    budget = judge(FRUIT, RECIPE).budget
    assert [each.name for each in budget.components] == list(COMPONENTS)
    assert [each.unit for each in budget.components] == ["", "mm", "mm", "", ""]
    assert [each.relative for each in budget.components] == pytest.approx(
        [0.03, 0.4 / sqrt(12) / 3, 0.38 / sqrt(12) / 3, 2 * 0.0125, 0.8 * 0.6 / 40]
    )
    assert budget.combined == pytest.approx(hypot(*(each.relative for each in budget.components)))
    assert budget.factor == pytest.approx(1.645, abs=0.001)
    assert budget.expanded == pytest.approx(budget.factor * budget.combined)
    assert budget.expanded_of("repeatability", "scale") == pytest.approx(budget.factor * hypot(0.03, 0.025))
    assert judge(FRUIT, RECIPE).areas[0].uncertainty_mm2 == pytest.approx(90 * 1.645 * budget.combined, rel=1e-3)


@pytest.mark.parametrize(
    "worse", [{"onset_uncertainty_mm": 1.0}, {"resolution_mm": 1.0}, {"scale_uncertainty": 0.06}, {"size": FruitSize()}]
)
def test_whatever_is_known_worse_widens_the_guard_band_of_pass_and_of_fail(worse):
    recipe = recipe_with(without_size="plain_limit")

    def outcome(area_mm2: float, press: Press) -> tuple[str, tuple[Reason, ...]]:
        points = tuple(replace(point, area_mm2=area_mm2 * point.closing_mm / 3) for point in press.points)
        verdict = judge(replace(press, points=points), recipe)
        return verdict.outcome, verdict.reasons

    vague = replace(FRUIT, **worse)
    assert outcome(88, FRUIT) == ("PASS", ())
    assert outcome(88, vague) == ("NO_RESULT", (Reason.NEAR_LIMIT,))
    assert outcome(124, FRUIT)[0] == "FAIL"
    assert outcome(124, vague) == ("NO_RESULT", (Reason.NEAR_LIMIT,))


def test_a_fruit_at_its_limit_is_kept_from_pass_as_often_as_the_coverage_says():
    """By the law of large numbers: errors drawn from the stated distributions, judged one by one."""
    random, passed, draws = np.random.default_rng(7), 0, 2000
    for _ in range(draws):
        late_mm = random.uniform(0, 0.4) - 0.2  # against the average, which limits found in the same way contain
        width_mm = random.uniform(-0.19, 0.19)
        length_mm = 40 + 0.6 * random.standard_normal()
        factor = (1 + 0.03 * random.standard_normal()) * (1 + 0.0125 * random.standard_normal()) ** 2
        area_mm2 = 100 * factor * (3 + late_mm + width_mm) / 3
        points = tuple(Measured(float(c), area_mm2 * c / 3, 1000 * c, 0.9) for c in range(4))
        passed += judge(replace(FRUIT, points=points, size=FruitSize(length_mm)), RECIPE).outcome == "PASS"
    assert passed / draws == pytest.approx(0.05, abs=0.015)
