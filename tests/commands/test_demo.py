"""`station demo` as a person uses it: all processes, all protocols, fruit after fruit."""

import json
import os
import re
import signal
import subprocess
import sys

import psutil
import pytest

from tests.hosts import fresh_host

ROW = re.compile(
    r"^(?P<number>\d+) +(?P<trigger>\d+) +(?P<record>\d+) +(?P<fruit>\w+)( \(damaged\))? "
    r".*?\b(?P<outcome>PASS|FAIL|NO_RESULT)\b"
)


@pytest.fixture
def demo(tmp_path, unused_ports):
    """Starts the demonstration with addresses of its own and the patience of a busy machine."""
    modbus, metrics, hmi, camera, console = unused_ports(5)
    host = fresh_host()
    (tmp_path / "station.yaml").write_text(
        f"modbus: {{port: {modbus}}}\nmetrics: {{port: {metrics}}}\nhmi: {{port: {hmi}}}\n"
        f"arm: {{host: {host}, stale_after_s: 1.0, link_lost_after_s: 4.0, watchdog_hz: 0.5}}\n"
        "gripper: {answer_timeout_s: 2.0, move_margin_s: 8.0, "
        f"urcap: {{host: {host}}}, modbus_rtu: {{host: {host}}}}}\n"
        "handshake: {begin_deadline_s: 10.0, station_lost_after_s: 30.0, plc_heartbeat_timeout_s: 30.0}\n"
        f"camera: {{oldest_s: 1.0, twin: {{port: {camera}}}}}\n"
        "service: {patience: 10.0, inspection_deadline_s: null}\n"
    )
    environment = {**os.environ, "STATION_HOME": str(tmp_path), "STATION_CONFIG": str(tmp_path / "station.yaml")}

    def begin(*arguments, **variables):
        command = [sys.executable, "-m", "station", "demo", "--console", str(console), *map(str, arguments)]
        return subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**environment, **variables}
        )

    return begin


def records_of(home, *arguments):
    command = [sys.executable, "-m", "station", "records", *(arguments or ("list", "--last", "100"))]
    environment = {**os.environ, "STATION_HOME": str(home)}
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=True, env=environment).stdout


@pytest.mark.timeout(300)
def test_every_fruit_is_decided_once_and_the_records_agree(demo, tmp_path):
    output, errors = demo("--count", 2, "--fruit", "blueberry", "--damaged", 0).communicate(timeout=280)
    assert errors == ""
    rows = [match for line in output.splitlines() if (match := ROW.match(line))]
    assert [row["number"] for row in rows] == ["1", "2"], output
    assert [row["trigger"] for row in rows] == ["1", "2"]
    assert {row["fruit"] for row in rows} == {"blueberry"}
    assert "2 fruits: " in output
    assert "damaged and passed: 0" in output
    for name in ("plc", "hmi"):
        lines = (tmp_path / "demo" / "logs" / f"{name}.log").read_text().splitlines()
        assert {json.loads(line)["process"] for line in lines} == {name}
    assert "calibrated the simulated sensor by its drawn ball" in output
    shown = records_of(tmp_path / "demo", "show", rows[0]["record"])
    assert re.search(rf"trigger: +{rows[0]['trigger']}\b", shown), shown
    assert re.search(r"size: +fruit length \d+\.\d mm \(given by the PLC\)", shown), shown
    assert re.search(r"calibration \d{8}T\d{6}Z: 0\.02\d+ mm/px ± \d\.\d%, measured", shown), shown
    listed = records_of(tmp_path / "demo")
    for row in rows:
        assert re.search(rf"^ *{row['record']}\b.*\bblueberry\b.*\b{row['outcome']}\b", listed, re.MULTILINE), listed


@pytest.mark.timeout(300)
def test_a_second_one_names_the_process_whose_address_is_in_use_and_ctrl_c_ends_everything(demo):
    process = demo()
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("metrics"):
            break
    second = demo()
    _, refused = second.communicate(timeout=120)
    assert second.returncode == 1
    assert "the process twin ended with exit code 2 before it was ready" in refused
    assert "is another twin running?" in refused
    children = psutil.Process(process.pid).children(recursive=True)
    assert len(children) >= 3
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert (process.returncode, errors) == (0, "")
    assert "fruits: " in output
    assert psutil.wait_procs(children, timeout=10)[1] == []


@pytest.mark.parametrize(
    ("variables", "device"),
    [
        ({"ARM_HOST": "192.0.2.7"}, "arm.host is 192.0.2.7"),
        (
            {"GRIPPER_DRIVER": "modbus_rtu", "GRIPPER_MODBUS_RTU_LINE": "serial"},
            "gripper.modbus_rtu.serial_port is /dev/ttyUSB0",
        ),
        ({"CAN_ENABLED": "true", "CAN_INTERFACE": "socketcan", "CAN_CHANNEL": "can0"}, "can.channel is can0"),
    ],
)
def test_a_site_with_real_devices_is_refused(demo, tmp_path, variables, device):
    # Without recipes a demonstration that is not refused ends at once, too.
    variables = {"RECIPES_FOLDER": str(tmp_path / "none"), **variables}
    process = demo(**{f"STATION_{name}": value for name, value in variables.items()})
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert errors.startswith(f"station: the demonstration works with the twin only, but {device}: unset")
