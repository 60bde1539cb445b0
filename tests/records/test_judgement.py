"""Judgement in a record: the fruit's limits and the uncertainty budget, stored, and read back as a table."""

import pytest

from station.inspection.fruit_size import NO_SIZE, FruitSize
from station.inspection.judge import judge
from station.messages.judge import AREA_AND_LIMIT, LIMIT_OF_LENGTH
from station.records.judgement import (
    budget_rows,
    is_judgement,
    judgement_measures,
    limit_factor,
)
from tests.inspection.test_sized_limits import RECIPE, pressed, recipe_with


def test_a_budget_is_kept_and_read_back_as_its_table():
    verdict = judge(pressed(80, FruitSize(48.0)), RECIPE)
    measures = judgement_measures(verdict)
    assert verdict.summary
    assert verdict.summary.id == AREA_AND_LIMIT.id
    limit = LIMIT_OF_LENGTH(fruit="Strawberry", length_mm=48.0, limit_mm2=100 * (48 / 40) ** 0.8)
    assert verdict.summary.parameters == {
        "closing_mm": 3.0, "area_mm2": 80.0, "uncertainty_mm2": pytest.approx(4.2, abs=0.05), "limit": limit
    }  # fmt: skip
    assert limit_factor(measures) == pytest.approx((48 / 40) ** 0.8, abs=1e-5)
    rows = dict(budget_rows(measures))
    assert list(rows)[-2:] == ["combined", "guard band, 1.64 times that"]
    assert rows["length of the fruit"] == pytest.approx(0.8 * 0.6 / 48)
    assert rows["guard band, 1.64 times that"] == pytest.approx(verdict.budget.expanded, rel=1e-3)
    assert all(is_judgement(name) for name in measures if name != "limit_factor")
    assert not is_judgement("onset_uncertainty_mm")


def test_nothing_is_kept_where_the_limit_is_not_known_and_records_of_before_have_none():
    without = judge(pressed(80, NO_SIZE), RECIPE)
    assert (without.summary, judgement_measures(without)) == (None, {})
    assert (list(budget_rows({})), limit_factor({})) == ([], 1.0)
    plain = judgement_measures(judge(pressed(80, NO_SIZE), recipe_with(without_size="plain_limit")))
    assert limit_factor(plain) == 1.0
    assert "limit_factor" not in plain
