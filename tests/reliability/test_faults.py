"""Some rows of the fault matrix, and that the matrix notices what does not hold."""

import re

import pytest


@pytest.mark.timeout(300)
def test_a_fault_has_one_outcome_and_the_station_comes_back(bench_faults):
    code, output, errors = bench_faults("service_killed", "--phase", "stepping")
    assert code == 0, output + errors
    assert re.fullmatch(r"service_killed +stepping +NO_RESULT.*: holds\n", output), output


@pytest.mark.timeout(300)
def test_an_expectation_that_is_not_met_is_told(bench_faults, tmp_path):
    (tmp_path / "wrong.yaml").write_text(
        "scenarios:\n  - {name: sound, fault: null, phases: [trigger], alarm: camera_lost, "
        "expected: {outcomes: [FAIL]}}\n"
    )
    code, output, _ = bench_faults("--scenarios", tmp_path)
    assert code == 1
    assert "outcome PASS (), expected FAIL; alarm camera_lost was not raised" in output


@pytest.mark.parametrize("text", ["scenarios: [{name: a}]", "a: ["])
def test_a_broken_scenario_file_is_named(bench_faults, tmp_path, text):
    (tmp_path / "broken.yaml").write_text(text)
    code, _, errors = bench_faults("--scenarios", tmp_path, "--list")
    assert code == 2
    assert str(tmp_path / "broken.yaml") in errors
    assert "Traceback" not in errors


def test_an_unknown_scenario_is_answered_with_those_there_are(bench_faults):
    code, output, _ = bench_faults("no_such_fault")
    assert code == 2
    assert "service_killed" in output
