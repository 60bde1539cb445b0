"""`station devices recover`: a person brings the arm back, never the station by itself."""

import pytest


@pytest.mark.timeout(300)
def test_after_the_persons_verb_the_arm_is_usable_again(make_cell):
    """One stop after the other: each finds the arm as a person's verb left it."""
    cell = make_cell()
    for fault, verb in (
        ("protective_stop", "protective-stop"),
        ("emergency_stop", "power"),
        ("pendant_stop", "program"),
    ):
        cell.twin(do="set", device="arm", fault=fault)
        cell.twin(do="clear", device="arm", fault=fault)
        done = cell.station("devices", "recover", verb, "--yes")
        assert (done.returncode, done.stdout) == (0, "the arm is ready\n"), (verb, done.stderr)
        assert cell.station("devices", "check").returncode == 0, verb


def test_without_a_persons_yes_nothing_is_done_and_what_still_stands_is_said_with_its_remedy(make_cell):
    cell = make_cell()
    cell.twin(do="set", device="arm", fault="protective_stop")
    cell.twin(do="clear", device="arm", fault="protective_stop")
    done = cell.station("devices", "recover", "protective-stop")
    assert done.returncode == 130
    assert "PROTECTIVE_STOP" in cell.station("devices", "check").stdout
    cell.twin(do="set", device="arm", fault="emergency_stop")  # ends the protective stop
    done = cell.station("devices", "recover", "power", "--yes")
    assert done.returncode == 1
    assert "emergency stop" in done.stderr
    assert "Traceback" not in done.stderr
