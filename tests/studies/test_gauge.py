"""The analysis of variance, the agreement of decisions, and the file of measurements."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.errors import BadInputError
from station.studies.agreement import agreement, cohen_kappa
from station.studies.gauge import analyse
from station.studies.gauge_report import aiag_class
from station.studies.gauge_table import Measurement, crossed, read_measurements, written

# Ten parts, three appraisers, three trials: the worked example of AIAG's MSA (4th edition, chapter III, section B).
AIAG = np.array(
    [
        [
            [0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
            [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
            [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31],
        ],
        [
            [0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
            [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
            [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50],
        ],
        [
            [0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
            [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
            [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16],
        ],
    ]
).transpose(2, 0, 1)


def test_the_published_example_comes_out_as_published():
    gauge = analyse(AIAG, tolerance=6 * 0.302373)
    squares = {source.name: source.sum_of_squares for source in gauge.sources}
    assert squares["parts"] == pytest.approx(88.3619, abs=5e-5)
    assert squares["operators"] == pytest.approx(3.1673, abs=5e-5)
    assert squares["interaction"] == pytest.approx(0.3590, abs=5e-5)
    assert gauge.pooled
    assert squares["equipment"] == pytest.approx(0.3590 + 2.7589, abs=1e-4)
    published = {"EV": 0.199933, "AV": 0.226838, "GRR": 0.302373, "PV": 1.042327, "TV": 1.085}
    for name, sigma in published.items():
        assert gauge.component(name).sigma == pytest.approx(sigma, abs=5e-4)
    assert gauge.component("GRR").study_percent == pytest.approx(27.9, abs=0.1)
    assert gauge.component("GRR").tolerance_percent == pytest.approx(100, abs=0.1)
    assert gauge.distinct_categories == 4


@given(st.integers(0, 2**31), st.integers(2, 7), st.integers(2, 4), st.integers(2, 4), st.floats(0, 3), st.floats(0, 3))
@settings(max_examples=15, deadline=None)
def test_sums_of_squares_are_those_of_fitted_models(seed, parts, operators, repeats, by_operator, crossed_by):
    """The same by another way: what is left over by least squares, model after model."""
    rng = np.random.default_rng(seed)
    values = (
        rng.normal(0, 2, (parts, 1, 1))
        + rng.normal(0, 1, (1, operators, 1)) * by_operator
        + rng.normal(0, 1, (parts, operators, 1)) * crossed_by
        + rng.normal(0, 1, (parts, operators, repeats))
    )
    part, operator = (axis.ravel() for axis in np.indices(values.shape)[:2])
    one, y = np.ones((values.size, 1)), values.ravel()
    of_parts, of_operators = np.eye(parts)[part], np.eye(operators)[operator]
    cells = np.eye(parts * operators)[part * operators + operator]

    def left(*columns: np.ndarray) -> float:
        design = np.hstack([one, *columns])
        return float(np.square(y - design @ np.linalg.lstsq(design, y, rcond=None)[0]).sum())

    additive, saturated = left(of_parts, of_operators), left(cells)
    gauge = analyse(values)
    found = {source.name: source for source in gauge.sources}
    assert found["parts"].sum_of_squares == pytest.approx(left(of_operators) - additive, rel=1e-6, abs=1e-6)
    assert found["operators"].sum_of_squares == pytest.approx(left(of_parts) - additive, rel=1e-6, abs=1e-6)
    assert found["interaction"].sum_of_squares == pytest.approx(additive - saturated, rel=1e-6, abs=1e-6)
    assert found["equipment"].sum_of_squares == pytest.approx(additive if gauge.pooled else saturated, rel=1e-6)
    assert gauge.pooled == ((found["interaction"].p or 0) > 0.25)
    variance = {one.name: one.sigma**2 for one in gauge.components}
    grr = variance["EV"] + variance["AV"] + variance.get("INT", 0.0)
    assert variance["GRR"] == pytest.approx(grr)
    assert variance["TV"] == pytest.approx(grr + variance["PV"])


def test_known_components_are_found_again():
    rng = np.random.default_rng(1)
    parts, operators, repeats = 400, 60, 4
    values = (
        rng.normal(0, 3.0, (parts, 1, 1))
        + rng.normal(0, 0.8, (1, operators, 1))
        + rng.normal(0, 0.5, (parts, operators, 1))
        + rng.normal(0, 0.4, (parts, operators, repeats))
    )
    gauge = analyse(values)
    assert not gauge.pooled
    for name, sigma, tolerance in (("PV", 3.0, 0.1), ("AV", 0.8, 0.2), ("INT", 0.5, 0.03), ("EV", 0.4, 0.02)):
        assert gauge.component(name).sigma == pytest.approx(sigma, rel=tolerance)


@pytest.mark.parametrize("unit", [1.0, 0.1])
def test_an_interaction_of_identical_repeats_is_not_repeatability(unit):
    """Areas in whole units, which hide a finer noise: the components are those with that noise."""
    rng = np.random.default_rng(0)
    cells = np.round(100 + 10 * rng.standard_normal((10, 1)) + 6 * rng.standard_normal((10, 3)))
    identical = unit * np.repeat(cells[..., None], 3, axis=2)
    gauge, with_noise = (
        analyse(table, tolerance=40 * unit)
        for table in (identical, identical + unit * 1e-6 * rng.standard_normal(identical.shape))
    )
    tested = {source.name: source for source in gauge.sources}
    assert (tested["interaction"].f, tested["interaction"].p) == (None, 0)
    assert not gauge.pooled
    assert gauge.component("EV").sigma == 0
    assert gauge.component("INT").sigma > 3 * unit
    assert [one.name for one in gauge.components] == [one.name for one in with_noise.components]
    for one, other in zip(gauge.components, with_noise.components, strict=True):
        assert one.sigma == pytest.approx(other.sigma, abs=1e-3)
        assert one.tolerance_percent == pytest.approx(other.tolerance_percent, abs=1e-3)


def test_identical_repeats_of_operators_who_differ_alike_at_every_part_have_no_interaction():
    """The means of three repeats are off by the computer's rounding, which is no variation."""
    parts, operators = np.array([9.1, 10.3, 12.7, 14.9, 10.1]), np.array([0.0, 0.1, 0.2])
    gauge = analyse(np.repeat((parts[:, None] + operators)[..., None], 3, axis=2))
    assert gauge.pooled
    assert gauge.component("EV").sigma == 0
    assert gauge.component("GRR").sigma == gauge.component("AV").sigma == pytest.approx(0.1)
    tested = {source.name: source for source in gauge.sources}
    assert (tested["interaction"].f, tested["interaction"].p) == (None, None)
    assert (tested["operators"].f, tested["operators"].p) == (None, 0)


@pytest.mark.parametrize("area", [0.0, 7.0, 7.1])
def test_a_gauge_that_always_says_the_same_has_no_categories(area):
    gauge = analyse(np.full((3, 2, 3), area))
    assert gauge.pooled
    assert all((source.f, source.p) == (None, None) for source in gauge.sources)
    assert gauge.component("TV").sigma == 0
    assert gauge.distinct_categories == 0


def test_a_gauge_without_any_variation_of_its_own_tells_any_number_of_parts_apart():
    parts = np.array([9.1, 10.3, 12.7, 14.9, 10.1])
    gauge = analyse(np.broadcast_to(parts[:, None, None], (5, 3, 2)), tolerance=10.0)
    assert gauge.component("GRR").sigma == 0
    assert gauge.distinct_categories is None
    assert aiag_class(gauge) == (
        "good", "GRR is 0.0 % of the tolerance: acceptable; any number of distinct categories (enough)."
    )  # fmt: skip


@pytest.mark.parametrize("values", [np.zeros((1, 2, 2)), np.zeros((2, 2, 1)), np.full((2, 2, 2), np.nan), np.zeros(8)])
def test_what_is_no_full_table_is_refused(values):
    with pytest.raises(ValueError, match="at least 2 parts"):
        analyse(values)


def test_kappa_of_a_textbook_table():
    """50 pairs: 20 both yes, 15 both no, 5 and 10 apart (Cohen's kappa 0.4)."""
    one = [True] * 25 + [False] * 25
    other = [True] * 20 + [False] * 5 + [True] * 10 + [False] * 15
    assert cohen_kappa(one, other) == pytest.approx(0.4)
    assert cohen_kappa(one, one) == 1
    assert cohen_kappa([True] * 4, [True] * 4) is None


def test_misses_and_false_alarms_are_told_apart():
    good = np.array([True, True, False, False])
    passed = np.array([[[True, True]], [[True, False]], [[False, False]], [[False, True]]])
    found = agreement(passed, ["A"], good).operators[0]
    assert (found.repeated, found.right) == (2, 2)
    assert found.misses == (1, 4)
    assert found.false_alarms == (1, 4)
    assert agreement(passed, ["A"]).operators[0].right is None


HEADER = "part,operator,repeat,area_mm2"


def full(extra: str = "") -> str:
    rows = [f"{p},{o},{r},{10 * p + r}{extra}" for p in (1, 2) for o in "AB" for r in (1, 2)]
    return "\n".join(rows) + "\n"


def test_a_file_is_read_as_it_was_written(tmp_path: Path):
    table = [
        Measurement(f"{p}", o, f"{r}", 10.5 * p + r, "PASS" if p == 1 else "FAIL", "PASS" if p == 1 else "FAIL")
        for p in (1, 2)
        for o in "AB"
        for r in (1, 2)
    ]
    path = tmp_path / "m.csv"
    path.write_bytes(written(table))
    assert read_measurements(path) == table
    ordered = crossed(read_measurements(path), "m.csv")
    assert ordered.areas_mm2.shape == (2, 2, 2)
    assert ordered.passed is not None
    assert ordered.good is not None
    assert ordered.good.tolist() == [True, False]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", ":1: expected the columns"),
        ("part,operator,area_mm2\n", "repeat is missing"),
        (f"{HEADER},colour\n", "'colour' is none of them"),
        (f"{HEADER}\n1,A,1\n", ":2: expected 4 columns, got 3"),
        (f"{HEADER}\n1,A,1,nan\n", ":2: area_mm2: expected a number from 0 up"),
        (f"{HEADER}\n1,A,1,-2\n", ":2: area_mm2"),
        (f"{HEADER}\n1,A,1,5\n1,A,1,6\n", ":3: the same part, operator and repeat as in line 2"),
        (f"{HEADER}\n,A,1,5\n", ":2: part: expected a name"),
        (f"{HEADER},outcome\n1,A,1,5,good\n", ":2: outcome: expected one of PASS"),
        (f"{HEADER}\n1,A,1,5\n", "at least 2 parts, 2 operators and 2 repeats"),
        (f"{HEADER}\n{full()}3,A,1,5\n", "got 1 of part 3 by operator A"),
        (f'{HEADER}\n"1,A\n', "is not a CSV file"),
    ],
)
def test_a_bad_file_is_refused_by_its_line(tmp_path: Path, text: str, message: str):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(BadInputError, match=r"m\.csv") as refusal:
        crossed(read_measurements(path), str(path))
    assert message in str(refusal.value)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path):
    path = tmp_path / "m.csv"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInputError, match="UTF-8"):
        read_measurements(path)
