"""`station grip` against the twin, read by `station analyze`; and what comes of a grip when something fails."""

import signal
from itertools import pairwise

import cv2
import numpy as np
import pytest

from station.devices.arm.faults import ArmCause, ArmFault
from station.messages import arm as arm_messages
from station.messages import camera as camera_messages
from station.messages import grip as messages
from tests.tables import read_table

OPEN_MM = 53.0


def test_a_grip_with_the_arm_gives_what_analyze_reads(make_cell, analyze, tmp_path):
    cell = make_cell("--fruit", "raspberry", "--seed", 3)
    out = tmp_path / "grip"
    done = cell.station("grip", "--yes", "--recipe", "raspberry", "--out", out)
    assert done.returncode == 0, done.stderr
    rows = read_table(out / "widths.csv")
    widths = [float(row["width_mm"]) for row in rows]
    assert len(rows) == 18
    assert widths == sorted(widths, reverse=True)
    assert all(abs(float(row["width_mm"]) - float(row["commanded_width_mm"])) <= 0.4 for row in rows)
    truth = [np.count_nonzero(np.asarray(cv2.imread(str(out / "truth" / row["image"]), 0))) for row in rows]
    assert truth[0] == 0
    assert all(before < after for before, after in pairwise(truth))
    assert cell.twin(do="state")["width_mm"] == pytest.approx(OPEN_MM, abs=0.5)

    report = tmp_path / "report"
    read = analyze(
        "--recipe", "raspberry", "--reference", out / "reference", "--widths", out / "widths.csv",
        "--out", report, out / "frames",
    )  # fmt: skip
    assert read.returncode == 0, read.stderr
    contacts = [row["contact"] for row in read_table(report / "results.csv")]
    assert contacts[0] == "0"
    assert contacts[1] == "1"


def test_on_a_bench_no_arm_is_asked(make_cell, tmp_path):
    cell = make_cell("--bench", "--fruit", "rubber_ball")
    done = cell.station("grip", "--yes", "--bench", "--recipe", "rubber_ball", "--out", tmp_path / "grip")
    assert done.returncode == 0, done.stderr
    rows = read_table(tmp_path / "grip" / "widths.csv")
    assert float(rows[0]["width_mm"]) == pytest.approx(46, abs=0.4)
    assert float(rows[-1]["width_mm"]) == pytest.approx(33, abs=0.4)
    assert len(rows) == 14
    truth = [np.asarray(cv2.imread(str(tmp_path / "grip" / "truth" / row["image"]), 0)).any() for row in rows]
    touched = [float(row["width_mm"]) for row, touching in zip(rows, truth, strict=True) if touching]
    assert max(touched) == pytest.approx(41.5, abs=1.0)


def test_an_empty_nest_is_said_and_the_gripper_opened(make_cell, tmp_path):
    cell = make_cell("--bench")
    cell.twin(do="remove")
    done = cell.station("grip", "--yes", "--bench", "--recipe", "strawberry", "--out", tmp_path / "grip")
    assert done.returncode == 1
    touched = messages.NOTHING_TOUCHED(largest_mm=53, smallest_mm=22, recipe="strawberry")
    assert str(touched) in done.stderr
    assert "Traceback" not in done.stderr
    assert cell.twin(do="state")["width_mm"] == pytest.approx(OPEN_MM, abs=0.5)


@pytest.mark.parametrize(
    ("device", "fault", "words"),
    [
        ("camera", "stuck", messages.BAD_FRAMES(number=10, faults=[camera_messages.FRAME_REPEATED()])),
        ("camera", "off", "camera twin at"),
        ("camera", "frame_torn", camera_messages.FRAME_TORN()),
    ],
)
def test_a_camera_that_fails_in_mid_grip_ends_it_and_lets_go(make_cell, tmp_path, device, fault, words):
    cell = make_cell("--bench", "--fruit", "strawberry")
    grip = cell.begin("grip", "--yes", "--bench", "--recipe", "strawberry", "--out", tmp_path / "grip")
    assert grip.stdout is not None
    assert grip.stdout.readline()
    cell.twin(do="set", device=device, fault=fault)
    _, errors = grip.communicate(timeout=60)
    assert grip.returncode == 1
    assert str(words) in errors
    assert "Traceback" not in errors
    assert cell.twin(do="state")["width_mm"] == pytest.approx(OPEN_MM, abs=0.5)
    assert (tmp_path / "grip" / "widths.csv").exists()


@pytest.mark.parametrize(
    ("device", "fault", "stop"),
    [
        ("arm", "protective_stop", ArmFault(ArmCause.PROTECTIVE_STOP, arm_messages.PROTECTIVE_STOP())),
        ("arm", "emergency_stop", ArmFault(ArmCause.EMERGENCY_STOP, arm_messages.EMERGENCY_STOP())),
    ],
)
def test_an_arm_that_is_stopped_on_its_way_back_is_left_to_a_person(make_cell, tmp_path, device, fault, stop):
    cell = make_cell("--fruit", "blueberry")
    grip = cell.begin("grip", "--yes", "--recipe", "blueberry", "--out", tmp_path / "grip")
    assert grip.stdout is not None
    assert grip.stdout.readline()
    cell.twin(do="set", device=device, fault=fault)
    _, errors = grip.communicate(timeout=60)
    assert grip.returncode == 1
    expected = (messages.NOT_LEFT(reason=stop.message), messages.FAILED_NOT_LEFT(reason=stop.message))
    assert any(str(each) in errors for each in expected)
    assert "Traceback" not in errors


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_grip_that_is_called_off_lets_go(make_cell, tmp_path, ending):
    cell = make_cell("--bench", "--fruit", "strawberry")
    grip = cell.begin("grip", "--yes", "--bench", "--recipe", "strawberry", "--out", tmp_path / "grip")
    assert grip.stdout is not None
    for _ in range(3):
        assert grip.stdout.readline()
    grip.send_signal(ending)
    _, errors = grip.communicate(timeout=60)
    assert grip.returncode == 130
    assert errors.strip() == "station: interrupted"
    assert cell.twin(do="state")["width_mm"] == pytest.approx(OPEN_MM, abs=0.5)


def test_a_folder_is_made_with_the_first_image_and_never_mixed_into(make_cell, tmp_path):
    cell = make_cell("--bench")
    out = tmp_path / "grip"
    cell.twin(do="set", device="camera", fault="off")
    assert cell.station("grip", "--yes", "--bench", "--recipe", "strawberry", "--out", out).returncode == 1
    assert not out.exists()
    (out / "frames").mkdir(parents=True)
    done = cell.station("grip", "--yes", "--bench", "--recipe", "strawberry", "--out", out)
    assert done.returncode == 2
    assert "name a new folder" in done.stderr
