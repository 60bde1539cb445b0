"""`station devices check` against a twin with one thing wrong at a time."""

import re
import subprocess
import sys

import pytest

from station.messages import arm as arm_messages
from station.messages import camera as camera_messages
from station.messages import gripper as gripper_messages
from station.messages.message import verbatim
from tests.hosts import fresh_host

SLOW = 24.0
"""Frames/s below which a camera of 30 is slow."""
DEVICES = ("arm controller", "arm RTDE", "arm programs", "gripper", "camera")


def verdicts(output: str) -> dict[str, str]:
    lines = [line for line in output.splitlines() if line and not line.startswith(" ")]
    return {device: line.split()[0] for line in lines for device in DEVICES if line[8:].startswith(device)}


def test_a_sound_cell_names_every_device_with_what_it_is(shared_cell):
    done = shared_cell.station("devices", "check")
    assert done.returncode == 0, done.stderr
    # On a busy machine the twin draws fewer frames than the camera should give, and that is reported.
    found = re.search(r"480x640, ([\d.]+) frames/s", done.stdout)
    assert found
    slow = str(camera_messages.REMEDY_SLOW(rate=30.0)) in done.stdout
    assert float(found[1]) <= SLOW if slow else float(found[1]) >= SLOW
    camera = "warning" if slow else "ok"
    assert verdicts(done.stdout) == dict.fromkeys(DEVICES, "ok") | {"gripper": "warning", "camera": camera}
    assert str(gripper_messages.CHECK_NOT_ACTIVE()) in done.stdout
    assert "PolyScope 5.22" in done.stdout
    assert "480x640" in done.stdout


@pytest.mark.parametrize(
    ("device", "fault", "name"),
    [
        ("arm", "off", "arm"),
        ("arm", "protective_stop", "arm controller"),
        ("arm", "local_mode", "arm controller"),
        ("gripper", "off", "gripper"),
        ("gripper", "over_temperature", "gripper"),
        ("camera", "off", "camera"),
        ("camera", "stuck", "camera"),
        ("camera", "garbage", "camera"),
        ("camera", "frame_black", "camera"),
    ],
)
def test_a_fault_is_told_with_its_remedy_and_exit_code_1(make_cell, shared_cell, device, fault, name):
    cell = make_cell() if device == "arm" else shared_cell  # an arm needs a person to bring it back
    cell.twin(do="set", device=device, fault=fault)
    done = cell.station("devices", "check")
    cell.twin(do="clear", device=device, fault=fault)
    assert done.returncode == 1
    assert name in done.stderr.removeprefix("station: not usable: ").strip().split(", ")
    assert "Traceback" not in done.stderr
    lines = done.stdout.splitlines()
    for number, line in enumerate(lines):
        if line.startswith("fault"):
            assert lines[number + 1].strip(), "a fault without a remedy"


def test_without_a_twin_nothing_is_usable_and_nothing_hangs(make_cell):
    cell = make_cell("--bench")
    cell.twin(do="set", device="gripper", fault="off")
    cell.twin(do="set", device="camera", fault="off")
    done = cell.station("devices", "check")
    assert done.returncode == 1
    assert "not usable: arm, camera, gripper" in done.stderr


@pytest.mark.parametrize(
    ("arm", "gripper", "expected"),
    [
        (
            "no-such-robot.invalid",
            "{driver: modbus_rtu, modbus_rtu: {serial_port: /dev/no-such-port}}",
            (
                arm_messages.DASHBOARD_UNKNOWN_HOST(address="no-such-robot.invalid:29999"),
                gripper_messages.UNREACHABLE(
                    place=gripper_messages.PLACE_MODBUS_RTU(unit=9, address="/dev/no-such-port")
                ),
                gripper_messages.REMEDY_SERIAL(),
            ),
        ),
        (
            "{absent}",
            "{urcap: {host: {absent}}}",
            (
                arm_messages.DASHBOARD_ABSENT(address="{absent}:29999"),
                gripper_messages.UNREACHABLE_BECAUSE(
                    place=gripper_messages.PLACE_URCAP(address="{absent}:63352"), reason=verbatim("Connection refused")
                ),
                gripper_messages.REMEDY_URCAP(),
            ),
        ),
    ],
)
def test_a_sites_wrong_addresses_are_named_with_what_to_correct(tmp_path, arm, gripper, expected):
    absent = fresh_host()
    file = tmp_path / "station.yaml"
    file.write_text(
        f"arm: {{host: {arm}}}\ngripper: {gripper}\n".replace("{absent}", absent)
        + "camera: {driver: digit, open_deadline_s: 0.3, digit: {serial: D00001}}\n"
    )
    command = [sys.executable, "-m", "station", "devices", "check", "--config", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1
    assert done.stderr == "station: not usable: arm, camera, gripper\n"
    for each in (*expected, arm_messages.REMEDY_HOST(), camera_messages.NONE_PLUGGED_IN(serial="D00001")):
        assert str(each).replace("{absent}", absent) in done.stdout
