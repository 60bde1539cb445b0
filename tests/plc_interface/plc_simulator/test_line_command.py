"""`station line` ended by a person before its time."""

import os
import signal
import socket
import subprocess
import sys

import pytest

PATIENCE_S = 60


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (("--count", "3"), 1, "station: the line was ended after 0 of 3 fruits; start it anew for the others\n"),
        ((), 0, ""),
    ],
)
def test_fruits_that_are_missing_are_told_by_the_exit_code(number, arguments, code, told):
    with socket.create_server(("127.0.0.1", 0)) as station:
        station.settimeout(PATIENCE_S)
        environment = {**os.environ, "STATION_MODBUS_PORT": str(station.getsockname()[1])}
        command = [sys.executable, "-m", "station", "line", *arguments]
        with subprocess.Popen(command, stdout=-1, stderr=-1, text=True, env=environment) as line:
            connection, _ = station.accept()  # a station that says nothing
            line.send_signal(number)
            shown, errors = line.communicate(timeout=PATIENCE_S)
            connection.close()
    assert (line.returncode, errors) == (code, told)
    assert "0 fruits" in shown
