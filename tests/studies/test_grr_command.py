"""`station grr` as a user gives it."""

import json
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from station.commands.grr import grr
from station.errors import BadInputError, StationError
from station.inspection.judge import judge
from station.settings.recipe import find_recipe
from station.studies import gauge_design, gauge_dummies
from station.studies import grr as grr_room
from station.studies.gauge_design import TwinDesign, study_on_twin
from station.studies.gauge_dummies import measure_dummy, stop_mm
from station.studies.gauge_grip import CALIBRATION_SD, FruitRig, Grip, last_limit_mm
from station.studies.gauge_report import render, tolerance_percents
from station.studies.gauge_table import Measurement, read_measurements
from station.studies.gauge_twin import (
    GaugeTask,
    Simulated,
    good_and_damaged_mm2,
    measure_part,
    part_of,
    pose_of,
    setup_of,
)
from station.twin.gel import MM_PER_PX
from station.vision.contact import Contact
from station.vocabulary import Flag


def run_command(*arguments: object) -> Result:
    """Run the command in this process, without its signal's handler."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        return CliRunner().invoke(grr, [str(one) for one in arguments])
    finally:
        signal.signal(signal.SIGTERM, before)


@pytest.fixture
def measurements(tmp_path: Path) -> Path:
    """A study of three parts, of which the last is damaged, with a little noise."""
    rows = ["part,operator,repeat,area_mm2,outcome,reference"]
    for number, (part, area, outcome) in enumerate((("a", 80, "PASS"), ("b", 90, "PASS"), ("c", 140, "FAIL"))):
        for operator in "AB":
            for repeat in (1, 2, 3):
                noise = 0.1 * ((7 * number + 3 * repeat + (operator == "B")) % 5)
                rows.append(f"{part},{operator},{repeat},{area + noise:.1f},{outcome},{outcome}")
    path = tmp_path / "measurements.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def test_measurements_of_a_file_are_analysed(measurements: Path, tmp_path: Path):
    out = tmp_path / "new" / "out"
    found = run_command(measurements, "--tolerance", 50, "--out", out)
    assert found.exit_code == 0, found.output
    assert "of the tolerance: acceptable" in found.output
    summary = json.loads((out / "grr.json").read_text())
    components = summary["components"]
    assert components["PV"]["sigma_mm2"] == pytest.approx(32, rel=0.05)
    assert components["GRR"]["tolerance_percent"] == pytest.approx(6 * components["GRR"]["sigma_mm2"] / 50 * 100)
    assert summary["distinct_categories"] > 50
    assert summary["agreement"]["all_alike"] == 3
    page = (out / "report.html").read_text()
    assert page.count("data:image/png") == 2
    assert "kappa" in page
    assert "Where it comes from" not in page
    assert summary["origins"] == []
    assert "http" not in page
    assert sorted(path.name for path in out.parent.iterdir()) == ["out"]


def test_identical_repeats_are_perfectly_repeatable_and_an_infinite_f_is_no_number(tmp_path: Path):
    rows = ["part,operator,repeat,area_mm2"]
    for part, areas in (("a", (80, 86)), ("b", (95, 90)), ("c", (140, 141))):
        for operator, area in zip("AB", areas, strict=True):
            rows += [f"{part},{operator},{repeat},{area}" for repeat in (1, 2, 3)]
    path = tmp_path / "measurements.csv"
    path.write_text("\n".join(rows) + "\n")
    found = run_command(path, "--tolerance", 50, "--out", tmp_path / "out")
    assert found.exit_code == 0, found.output
    text = (tmp_path / "out" / "grr.json").read_text()
    summary = json.loads(text)
    assert not summary["interaction_pooled"]
    assert summary["components"]["EV"]["sigma_mm2"] == 0
    assert summary["components"]["INT"]["sigma_mm2"] > 3
    assert not {"Infinity", "NaN"} & set(text.replace(",", " ").split())
    page = (tmp_path / "out" / "report.html").read_text()
    assert "<td>-</td><td>0.0000</td>" in page
    assert ">inf<" not in page


def test_without_a_tolerance_the_total_variation_judges(measurements: Path, tmp_path: Path):
    found = run_command(measurements, "--out", tmp_path / "out")
    assert found.exit_code == 0, found.output
    assert "of the total variation" in found.output
    assert "of the tolerance" not in (tmp_path / "out" / "report.html").read_text()


def test_what_cannot_be_done_is_told(measurements: Path, tmp_path: Path):
    assert "either a CSV file of measurements or --twin" in run_command("--out", tmp_path / "a").output
    assert "either a CSV file" in run_command(measurements, "--twin", "--out", tmp_path / "a").output
    assert "--dummies goes with --twin" in run_command(measurements, "--dummies", "--out", tmp_path / "a").output
    assert "not in the range" in run_command("--twin", "--parts", 1, "--out", tmp_path / "a").output
    assert "not in the range" in run_command(measurements, "--tolerance", 0, "--out", tmp_path / "a").output
    for name, out in (("nothing.csv", tmp_path / "a"), (measurements.name, tmp_path)):
        found = run_command(tmp_path / name, "--out", out)
        assert isinstance(found.exception, BadInputError)
    assert sorted(path.name for path in tmp_path.iterdir()) == [measurements.name]


def test_a_full_disk_leaves_nothing(measurements: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(_descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    found = run_command(measurements, "--out", tmp_path / "out")
    assert isinstance(found.exception, StationError)
    assert "nothing is stored: free space" in str(found.exception)
    assert [path.name for path in tmp_path.iterdir()] == [measurements.name]


def test_interrupted_in_the_middle_it_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    gripped: list[GaugeTask] = []

    def interrupted(task: GaugeTask) -> object:
        if gripped:
            raise KeyboardInterrupt
        gripped.append(task)
        return measure_part(task)

    monkeypatch.setattr(gauge_design, "measure_part", interrupted)
    found = run_command("--twin", "--fruit", "blueberry", "--parts", 2, "--jobs", 1, "--out", tmp_path / "out")
    assert found.exit_code != 0
    assert "Aborted" in found.output
    assert gripped
    assert list(tmp_path.iterdir()) == []


def test_what_varies_is_told_row_by_row(monkeypatch: pytest.MonkeyPatch):
    """Truths of which the first varies by part alone, the second by repeat too, and areas that differ by operator."""

    def gripped(task: GaugeTask) -> Simulated:
        part, operator, repeat = 50.0 * task.part, 4.0 * task.operator, 1.0 * task.repeat
        return Simulated(Measurement(*task.names, 10 + part + operator + repeat), (part, part + repeat))

    monkeypatch.setattr(gauge_design, "measure_part", gripped)
    done: list[None] = []
    study = study_on_twin(TwinDesign("blueberry", 4, 3, 2, 0, 1), 60.0, lambda: done.append(None))
    assert len(done) == 4 * 3 * 2
    laid, counted, measured = (tolerance_percents(one.gauge) for one in study.origins)
    repeats = 100 * 6 * np.sqrt(0.5) / 60
    assert laid == pytest.approx([0, 0, 0, 0], abs=1e-6)
    assert counted[3] == pytest.approx(counted[0])
    assert counted[0] == pytest.approx(repeats * np.sqrt(12 / 18))  # nothing else: 12 of its degrees in 18, pooled
    assert measured[1] == pytest.approx(100 * 6 * 4 / 60, rel=0.01)
    assert study.origins[-1].gauge is study.gauge
    stored = json.loads(json.dumps(grr_room.summary(study)))["origins"]
    assert [row["name"] for row in stored] == [one.name for one in study.origins]
    assert stored[1]["components"]["GRR"]["tolerance_percent"] == counted[3]
    page = render(study)
    for one in study.origins:
        assert one.name.replace("'", "&#39;") in page


def test_the_gauge_alone_repeats(tmp_path: Path):
    """The smallest and the largest ball: they differ far beyond the gauge's own variation."""
    out = tmp_path / "out"
    found = run_command(
        "--twin", "--dummies", "--parts", 2, "--operators", 2, "--repeats", 2, "--jobs", 1, "--out", out
    )
    assert found.exit_code == 0, found.output
    summary = json.loads((out / "grr.json").read_text())
    assert summary["agreement"] is None
    assert summary["components"]["GRR"]["tolerance_percent"] < 25  # of eight measurements alone
    held, measured = (row["components"] for row in summary["origins"])
    assert measured == summary["components"]
    assert 0 < held["EV"]["sigma_mm2"] < measured["EV"]["sigma_mm2"]
    assert held["PV"]["sigma_mm2"] == pytest.approx(measured["PV"]["sigma_mm2"], rel=0.1)
    assert summary["distinct_categories"] >= 5
    small, *_, large = read_measurements(out / "measurements.csv")
    limit_mm2 = find_recipe("strawberry").damage.area[-1].area_mm2
    assert small.area_mm2 == pytest.approx(0.6 * limit_mm2, rel=0.1)
    assert large.area_mm2 == pytest.approx(limit_mm2, rel=0.05)
    page = (out / "report.html").read_text()
    assert "firm balls of 20 to 38 mm" in page
    assert "0 of 8 readings" in page, "none is flagged, though so large a ball leaves little background on the gel"


def test_a_flagged_reading_is_made_again(monkeypatch: pytest.MonkeyPatch):
    """The method flags the first two readings, then all of another ball's."""
    pressed: list[float] = []

    class Doubtful:
        def __init__(self, *_what: object) -> None:
            pass

        def held(self, closing_mm: float) -> Contact:
            pressed.append(closing_mm)
            flags = frozenset[Flag]() if len(pressed) == 3 else frozenset({Flag.LOW_CONFIDENCE})
            return Contact(np.zeros((640, 480), np.uint8), 1000 * len(pressed), None, flags)

    monkeypatch.setattr(gauge_dummies, "Grip", Doubtful)
    task = GaugeTask("strawberry", 3, 0, 0, 0)
    found, hopeless = measure_dummy(task, 2), measure_dummy(task._replace(part=1), 2)
    assert (found.refused, hopeless.refused) == (2, 4)
    assert found.measurement.area_mm2 == pytest.approx(3000 * MM_PER_PX**2)
    assert len(pressed) == 3 + 5
    assert len(set(pressed)) == len(pressed)
    assert pressed == pytest.approx([stop_mm("strawberry")] * len(pressed), abs=0.1)


def test_a_gauge_press_is_judged_with_the_uncertainty_of_gripper_and_scale():
    task, recipe = GaugeTask("blueberry", 3, 0, 0, 0), find_recipe("blueberry")
    rig = FruitRig(part_of(task), pose_of(task), None, 5)
    pressed = Grip(recipe, rig).press(0.3, 0.0)
    for press in (pressed.as_stopped, pressed.on_to_the_threshold):
        standard = {each.name: each.standard for each in judge(press, recipe).budget.components}
        assert standard["gripper"] == pytest.approx(rig.finest_step_mm / np.sqrt(12))
        assert standard["scale"] == CALIBRATION_SD > 0


def test_the_twin_s_measurement_is_the_station_s(tmp_path: Path):
    """One press of a smooth fruit: the area at the last limit's closing is near its truth, and repeats to the digit."""
    task = GaugeTask("blueberry", 3, 0, 0, 0)
    once = measure_part(task)
    assert once == measure_part(task)
    again = measure_part(task._replace(repeat=1))
    assert once != again
    measured = once.measurement
    assert (measured.part, measured.operator, measured.repeat, measured.reference) == ("1", "A", "1", "PASS")
    good, damaged = good_and_damaged_mm2("blueberry", 3)
    assert 1.2 * good < damaged < 2 * good
    assert measured.area_mm2 == pytest.approx(good, rel=0.35)
    (laid, counted), (laid_again, counted_again) = once.truths_mm2, again.truths_mm2
    assert laid == laid_again == pytest.approx(good, rel=0.35)
    assert counted != counted_again
    assert min(counted, counted_again) > laid  # the first contact is seen late, so the fruit is pressed further
    assert measured.area_mm2 == pytest.approx(counted, rel=0.15)
    assert last_limit_mm(find_recipe("blueberry")) == 3


def test_operators_differ_and_every_second_fruit_is_bruised():
    task = GaugeTask("strawberry", 3, 0, 0, 0)
    assert setup_of(task).unit is None
    assert setup_of(task._replace(operator=1)) != setup_of(task._replace(operator=2))
    assert setup_of(task) == setup_of(task._replace(part=4, repeat=2))
    assert [part_of(task._replace(part=part)).bruised for part in range(4)] == [False, True, False, True]
    assert part_of(task) == part_of(task._replace(operator=2, repeat=1))
    assert pose_of(task) == pose_of(task._replace(repeat=1)) != pose_of(task._replace(operator=1))
