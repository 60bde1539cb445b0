"""The whole station started again over a configuration that a person broke meanwhile."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import urllib.request

import pytest
from pymodbus.client import ModbusTcpClient

from tests.hosts import fresh_host
from tests.ports import free_port


@pytest.fixture
def site(tmp_path):
    """Free addresses, a home folder, and the file that has them, as the unit names both."""
    host = fresh_host()
    values = {
        "home": str(tmp_path / "home"),
        "arm": {"host": host},
        "gripper": {"urcap": {"host": host}, "modbus_rtu": {"host": host}},
        "camera": {"twin": {"port": free_port()}},
        **{name: {"port": free_port()} for name in ("modbus", "hmi", "metrics")},
        "records": {"free_reserve_mb": 1},
        "service": {"bench": True},
    }
    (tmp_path / "station.yaml").write_text(json.dumps(values))
    return tmp_path / "station.yaml", values


@contextlib.contextmanager
def running(file, values, log):
    """`station run` from READY to its orderly end."""
    environment = {**os.environ, "STATION_CONFIG": str(file), "STATION_HOME": values["home"]}
    with log.open("w") as errors, subprocess.Popen(
        [sys.executable, "-m", "station", "run"], stdout=subprocess.PIPE, stderr=errors, text=True, env=environment
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            assert any(line.startswith("running; Ctrl-C") for line in process.stdout), log.read_text()
            yield
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=60)
    assert process.returncode == 0, log.read_text()


def station(file, values, *arguments):
    environment = {**os.environ, "STATION_CONFIG": str(file), "STATION_HOME": values["home"]}
    command = [sys.executable, "-m", "station", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, env=environment)


def page(values, name, path):
    with urllib.request.urlopen(f"http://127.0.0.1:{values[name]['port']}{path}", timeout=20) as answer:
        return answer.read().decode()


@pytest.mark.timeout(240)
def test_a_mistake_in_the_file_does_not_keep_the_station_from_its_next_start(site, tmp_path):
    file, values = site
    with running(file, values, tmp_path / "first.log"):
        metrics = page(values, "metrics", "/metrics")
        assert 'station_alarms_active{id="configuration_broken",priority="low"} 0.0' in metrics
        for link in ("camera", "gripper", "plc", "plc_interface"):
            assert f'station_link_age_seconds{{link="{link}"}}' in metrics, "nothing is connected, which alerts report"
    file.write_text("modbus: {port: twelve}\n")
    with running(file, values, tmp_path / "second.log"):
        active = [line for line in page(values, "metrics", "/metrics").splitlines() if "configuration_broken" in line]
        assert active
        assert active[0].endswith(" 1.0"), active
        assert "<html" in page(values, "hmi", "/")
        with ModbusTcpClient("127.0.0.1", port=values["modbus"]["port"]) as plc:
            assert not plc.read_holding_registers(0, count=1, device_id=1).isError()
        for command in (("alarms", "list"), ("records", "backup", str(tmp_path / "copy"))):
            done = station(file, values, *command)
            assert done.returncode == 0, done.stderr
            assert "modbus.port" in done.stderr
            assert "the last good configuration is used" in done.stderr
        done = station(file, values, "devices", "recover", "power", "--yes")
        assert "the last good configuration is used" in done.stderr, "this bench has no arm, which the station reports"
    log = (tmp_path / "second.log").read_text()
    assert "modbus.port" in log
    assert "the last good configuration is used" in log


def test_a_first_start_over_a_broken_file_reports_the_mistake_and_ends(site):
    file, values = site
    file.write_text("modbus: {port: twelve}\n")
    environment = {**os.environ, "STATION_CONFIG": str(file), "STATION_HOME": values["home"]}
    done = subprocess.run(
        [sys.executable, "-m", "station", "run"], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 2
    assert "modbus.port" in done.stderr
    assert "Traceback" not in done.stderr
