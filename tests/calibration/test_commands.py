"""`station calibrate` and `station verify` as a person runs them, against a twin on the real wire."""

import os
import signal
import subprocess

import pytest

from station.calibration.report import calibration_files
from station.calibration.store import CalibrationStore
from station.records.open import lock_folder

pytestmark = pytest.mark.timeout(600)

EMPTY = "take out what is between them"
"""What a person reads before the gripper is activated."""
BALL = "ball lies in its holder"
"""What a person reads before the ball is pressed."""


def begin(site, *arguments):
    return subprocess.Popen(
        site.command(*arguments), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def until(process, words):
    for line in process.stdout:
        if words in line:
            return line
    pytest.fail(f"{words!r} was never printed: {process.stderr.read()}")


def enter(process):
    process.stdin.write("\n")
    process.stdin.flush()


@pytest.mark.timeout(900)
def test_calibrate_at_two_places_verify_and_analyze_by_it(site, tmp_path):
    process = begin(site, "calibrate", "--operator", "anna", "--place", "3,0")
    until(process, EMPTY)
    enter(process)
    until(process, BALL)
    enter(process)
    until(process, "lay the ball 3 mm to the right")
    site.twin(do="fruit", kind="rubber_ball", x_mm=3.0)
    output, errors = process.communicate("\n", timeout=280)
    assert process.returncode == 0, errors
    store = CalibrationStore(site.home)
    calibration = store.current(site.serial)
    assert calibration is not None
    assert calibration.operator == "anna"
    assert calibration.scale_measured
    assert abs(calibration.mm_per_px / 0.0266 - 1) < 2 * calibration.scale_uncertainty  # four standard deviations
    assert str(store.folder(calibration) / "report.html") in output

    listed = site.station("calibrate", "list")
    assert str(calibration.summary()) in listed.stdout
    site.twin(do="fruit", kind="rubber_ball")
    good = site.station("verify", "--yes")
    assert good.returncode == 0, good.stdout + good.stderr
    assert "PASS; look at" in good.stdout
    site.twin(do="set", device="camera", fault="gel_torn")
    bad = site.station("verify", "--yes")
    assert bad.returncode == 1
    assert "FAIL  tear" in bad.stdout
    assert "station: not verified: tear: change the gel" in bad.stderr
    shown = site.station("calibrate", "show", calibration.id)
    assert "PASS" in shown.stdout
    assert "FAIL" in shown.stdout

    trail = site.station("audit", "show").stdout
    assert trail.count("calibration.stored") == 1
    assert trail.count("calibration.verified") == 2

    folder = store.folder(calibration)
    images = ["--reference", folder / "reference.png", "--out", tmp_path / "out", folder / "press_07.png"]
    analyzed = site_analyze(site, "--unit", site.serial, *images)
    assert analyzed.returncode == 0, analyzed.stderr
    header, row = (tmp_path / "out" / "results.csv").read_text().splitlines()
    cells = dict(zip(header.split(","), row.split(","), strict=True))
    assert float(cells["area_mm2"]) == pytest.approx(int(cells["area_px"]) * calibration.mm_per_px**2, rel=1e-3)
    assert f"calibration {calibration.id} of {site.serial}" in (tmp_path / "out" / "report.html").read_text()
    unknown = site_analyze(site, "--unit", "D00000", *images)
    assert unknown.returncode == 2
    assert "has no calibration" in unknown.stderr
    assert "Traceback" not in analyzed.stderr + unknown.stderr + bad.stderr


def site_analyze(site, *arguments):
    command = [*site.command("analyze", *arguments)[:-2]]
    environment = {**os.environ, "STATION_HOME": str(site.home)}
    return subprocess.run(command, capture_output=True, text=True, timeout=200, check=False, env=environment)


def test_called_off_in_the_middle_nothing_is_stored_and_the_jaws_open(site):
    process = begin(site, "calibrate", "--yes")
    until(process, " 6/14")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=200)
    assert process.returncode == 130
    assert "interrupted" in errors
    assert not (site.home / "calibrations").exists()
    assert site.twin(do="state")["width_mm"] > 52


def test_it_asks_first_and_an_input_that_has_ended_calls_it_off(site):
    done = subprocess.run(site.command("calibrate"), input="", capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 130
    assert "hands are away" in done.stdout
    assert site.twin(do="state")["width_mm"] > 52


@pytest.mark.parametrize(("command", "prompt"), [("calibrate", BALL), ("grip", "put the fruit in its place")])
def test_a_gripper_is_activated_with_empty_jaws_before_the_ball_or_the_fruit_is_requested(
    site, tmp_path, command, prompt
):
    options = ("--recipe", "rubber_ball", "--out", tmp_path / "grip") if command == "grip" else ()
    process = begin(site, command, *options)
    assert process.stdout is not None
    assert EMPTY in process.stdout.readline()
    assert site.twin(do="state")["width_mm"] > 52
    site.twin(do="remove")
    enter(process)
    assert prompt in process.stdout.readline()
    process.communicate(timeout=200)
    assert process.returncode == 130
    again, _ = begin(site, "calibrate").communicate(timeout=200)
    assert EMPTY not in again, "the gripper is active"
    assert BALL in again


def test_nothing_is_verified_without_a_calibration_of_this_very_unit(site):
    folder = site.home / "calibrations" / "D11111"
    folder.mkdir(parents=True)
    done = site.station("verify", "--yes")
    assert done.returncode == 1
    assert f"unit {site.serial} has no calibration" in done.stderr
    assert "calibrated are: D11111: is this the right sensor?" in done.stderr


def test_after_a_changed_gel_nothing_is_verified_by_the_old_calibration_which_old_images_are_measured_by(
    site, draft, station_here, tmp_path
):
    store, here = CalibrationStore(site.home), ("--config", site.configuration)
    done = station_here("calibrate", "gel-changed", "--operator", "ben", *here)
    assert done.returncode == 0, done.stderr
    assert f"sensor {site.serial}: it had no calibration in force; calibrate it" in done.stdout
    calibration = draft.calibration.model_copy(update={"serial": site.serial})
    store.add_calibration(calibration, calibration_files(draft))
    golden = site.home / "golden_reference.png"
    golden.write_bytes(b"of the old gel")
    assert "not in force" not in station_here("calibrate", "list", *here).stdout

    done = station_here("calibrate", "gel-changed", "--operator", "ben", *here)
    assert done.returncode == 0, done.stderr
    assert f"its calibration {calibration.id} is not in force any more; calibrate it" in done.stdout
    assert not golden.exists()
    assert "of an earlier gel: not in force" in station_here("calibrate", "list", *here).stdout
    trail = station_here("audit", "show", *here).stdout
    assert trail.count("calibration.gel_changed") == 2
    verified = site.station("verify", "--yes")
    assert verified.returncode == 1
    assert "ben): calibrate it with the ball" in verified.stderr

    folder = store.folder(calibration)
    images = ["--reference", folder / "reference.png", "--out", tmp_path / "out", folder / "press_07.png"]
    analyzed = site_analyze(site, "--unit", site.serial, *images)
    assert analyzed.returncode == 0, analyzed.stderr
    assert f"calibration {calibration.id} of {site.serial}" in (tmp_path / "out" / "report.html").read_text()


def test_no_gel_of_a_camera_that_is_no_sensor_is_changed(tmp_path, station_here):
    configuration = tmp_path / "station.yaml"
    configuration.write_text("home: home\ncamera: {driver: replay}\n")
    done = station_here("calibrate", "gel-changed", "--config", configuration)
    assert done.returncode == 2
    assert "replay is no sensor that could be calibrated" in done.stderr
    assert not (tmp_path / "home").exists()


def test_a_running_station_keeps_its_devices(site, tmp_path):
    lock = lock_folder(site.home / "records")
    try:
        grip = ("grip", "--recipe", "rubber_ball", "--out", tmp_path / "grip")
        for command in (("calibrate", "--yes"), ("verify", "--yes"), ("calibrate", "gel-changed"), grip):
            done = site.station(*command)
            assert done.returncode == 1
            assert "the devices are in use" in done.stderr
            assert "stop the station" in done.stderr
    finally:
        os.close(lock)


def test_bad_places_and_bad_names_are_bad_usage(site, station_here):
    for arguments in (("--place", "4"), ("--place", "a,b"), ("--place", "40,0")):
        assert station_here("calibrate", *arguments, "--config", site.configuration).returncode == 2
    done = site.station("calibrate", "--yes", "--place", "0.5,0")
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    done = station_here("calibrate", "show", "yesterday", "--config", site.configuration)
    assert done.returncode == 2
    assert "there is no calibration 'yesterday'" in done.stderr


@pytest.mark.timeout(900)
def test_with_the_arm_a_dead_led_is_refused_and_shown_and_the_mended_sensor_is_calibrated_and_verified(cell):
    cell.twin(do="set", device="camera", fault="led_dead")
    refused = cell.station("calibrate", "--yes", "--operator", "anna")
    assert refused.returncode == 1
    assert "LED is dead" in refused.stderr
    [folder] = (cell.home / "refused_calibrations" / cell.serial).iterdir()
    assert f"look at {folder / 'report.html'}" in refused.stderr
    assert "LED is dead" in (folder / "report.html").read_text()
    assert (folder / "reference.png").stat().st_size > 10_000
    assert "nothing is calibrated yet" in cell.station("calibrate", "list").stdout
    assert "Traceback" not in refused.stderr

    cell.twin(do="clear", device="camera")
    calibrated = cell.station("calibrate", "--yes")
    assert calibrated.returncode == 0, calibrated.stdout + calibrated.stderr
    verified = cell.station("verify", "--yes")
    assert verified.returncode == 0, verified.stdout + verified.stderr
    assert "PASS; look at" in verified.stdout
    assert cell.twin(do="state")["width_mm"] > 52
