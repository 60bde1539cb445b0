"""Benchmark of a fleet: a difference in any book is found, and the made histories are whole."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from benchmarks.fleet import cohort, metrics_year, stations
from benchmarks.fleet.year import equal
from plc_interface.plc_simulator.program import Decision, Passage
from station.settings.configuration import Configuration


def passage(number: int, decision: Decision) -> Passage:
    return Passage(number, number, decision, (), number, 40.0, 3.0, 3.0, 0, None)


def cell(*decisions: Decision) -> stations.Cell:
    made = stations.Cell("station-1", Configuration(), Path("station.yaml"), console_port=1, seed=1)
    made.passages = [passage(number, decision) for number, decision in enumerate(decisions, 1)]
    return made


def test_books_that_agree_have_no_difference_and_each_other_one_is_named():
    right = cell(Decision.PASS, Decision.FAIL)
    own, arrived, counted = {1: "PASS", 2: "FAIL"}, [(2, "FAIL"), (1, "PASS")], {"PASS": 1, "FAIL": 1}
    assert stations.disagreements(right, own, arrived, counted, 2) == []
    (difference,) = stations.disagreements(right, own, arrived[:1], counted, 2)
    assert "PostgreSQL has [(2, 'FAIL')]" in difference
    (difference,) = stations.disagreements(right, own, [*arrived, (1, "PASS")], counted, 2)
    assert "PostgreSQL has" in difference, "one that is there twice"
    (difference,) = stations.disagreements(right, own, arrived, {"PASS": 2, "FAIL": 1}, 2)
    assert "Prometheus counts" in difference
    (difference,) = stations.disagreements(right, own, arrived, counted, 3)
    assert "2 of 3 fruit decided" in difference
    late = cell(Decision.PASS, Decision.FAIL)
    late.passages[1] = replace(late.passages[1], reasons=("late",))
    assert stations.disagreements(late, own, arrived, counted, 2) == ["station-1: the PLC saw {'late': 1} []"]
    refused = cell(Decision.PASS, Decision.FAIL, Decision.REFUSED)
    refused.passages[2] = replace(refused.passages[2], sequence=0, reasons=("not_ready",))
    (difference,) = stations.disagreements(refused, own, arrived, counted, 3)
    assert difference == "station-1: the PLC saw {'refused': 1} ['refused: not_ready']"


def test_a_run_with_another_number_or_without_a_sample_differs():
    first = cohort.Run(0, 1.0, {"00001.json": b"1", "00002.json": b"2"})
    assert cohort.different([first, first._replace(workers=2)]) == []
    other = cohort.Run(2, 1.0, {"00001.json": b"3"})
    assert cohort.different([first, other]) == ["00001.json with 2 workers", "00002.json with 2 workers"]


def test_answers_are_equal_in_any_order_and_only_within_the_tolerance():
    some = [("a", 1, 0.5), ("b", 2, None)]
    assert equal(some, some[::-1], 1e-9)
    assert not equal(some, some[:1], 1e-9)
    assert not equal(some, [("a", 2, 0.5), ("b", 2, None)], 1e-9)
    assert not equal(some, [("a", 1, 0.51), ("b", 2, None)], 0.01)
    assert equal(some, [("a", 1, 0.51), ("b", 2, None)], 0.025)


def test_blocks_of_a_year_join_and_are_aligned():
    end_s = 1_790_006_400
    found = list(metrics_year.blocks(end_s, 365))
    assert found[0][0] == end_s - 365 * metrics_year.DAY_S
    assert found[-1][1] == end_s
    assert all(one[1] == other[0] and one[1] % metrics_year.BLOCK_S == 0 for one, other in pairwise(found))


def test_a_block_can_be_read_and_has_alarms_on_the_last_day_only(tmp_path):
    file, end_s = tmp_path / "block.txt", 10 * metrics_year.DAY_S
    written = metrics_year.write_block(file, ["station-1"], end_s - 2 * metrics_year.DAY_S, end_s, end_s)
    lines = file.read_text().splitlines()
    samples = [line for line in lines if not line.startswith("#")]
    assert len(samples) == written
    alarms = [int(line.rpartition(" ")[2]) for line in samples if line.startswith("station_alarms_active")]
    assert min(alarms) == end_s - metrics_year.DAY_S
    assert lines[-1] == "# EOF"
    families = [line for line in lines if line.startswith("# TYPE")]
    assert len(families) == len(set(families)), "a family in two places is refused by promtool"
