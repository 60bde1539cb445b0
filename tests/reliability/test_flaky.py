"""Timing-bound tests: how they are found, and the report on the stored rounds of playing them."""

from benchmarks.reliability.flaky import Round, failures, played, timing_bound
from benchmarks.reliability.together import STATIONS
from tests.conftest import TOGETHER

pytest_plugins = ("pytester",)

FILE = """
def waits(until):
    until(lambda: True)

def test_a_sum():
    assert 1 + 1 == 2

def test_an_end(eventually):
    eventually(lambda: True)

def test_a_limit():
    run(deadline_s=2.0)
"""


def played_with(seed: int, *failed: str) -> Round:
    return Round(date="2026-11-26", commit="c", seed=seed, tests=300, failed=list(failed), minutes=2.5, load=6.0 + seed)


def test_what_reads_a_clock_or_waits_is_timing_bound_and_a_sum_is_not(tmp_path):
    folder = tmp_path / "tests"
    (folder / "room").mkdir(parents=True)
    (folder / "room" / "test_some.py").write_text(FILE)
    assert timing_bound(folder) == [
        "tests/room/test_some.py::test_an_end",
        "tests/room/test_some.py::test_a_limit",
    ]


def test_a_failure_is_open_until_a_round_has_passed_since():
    rounds = [played_with(1, "a::one", "b::two"), played_with(2, "a::one"), played_with(3)]
    assert failures(rounds)[2:] == ["| `a::one` | 2 | 1, 2 | 1 |", "| `b::two` | 1 | 1 | 2 |"]
    text = " ".join(played(rounds, 100, "2 cores"))
    assert "**3** of the 100 rounds" in text
    assert "passed in 1." in text
    assert "900 runs of a test in all, of which   3 failed" in text
    assert "load 7.0 to 9.0" in text


def test_tests_that_share_a_station_run_in_few_workers_and_others_in_any(pytester):
    tests = pytester.mkpydir("tests")
    for folder in ("hmi", "hmi_pages", "records"):
        (tests / folder).mkdir()
        for name in "abcdef":
            (tests / folder / f"test_{folder}_{name}.py").write_text(
                f"import os\ndef test_it():\n    print('{folder} by', os.environ['PYTEST_XDIST_WORKER'])\n"
            )
    options = ("-n", "5", "-rP", "-p", "no:cacheprovider", "-p", "benchmarks.reliability.together", "tests")
    result = pytester.runpytest_subprocess(*options)
    result.assert_outcomes(passed=18)
    by = {
        folder: {line for line in result.outlines if line.startswith(f"{folder} by")}
        for folder in (*STATIONS, "records")
    }
    assert len(by.pop("records")) > 1
    assert {folder: len(lines) for folder, lines in by.items()} == STATIONS


def test_folders_of_a_station_are_those_that_a_whole_run_keeps_together():
    assert {(folder,) for folder in STATIONS} <= set(TOGETHER)
