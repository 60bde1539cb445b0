"""`station line` ended by a person before its time, and at its end."""

import asyncio
import os
import signal
import socket
import subprocess
import sys

import pytest

from plc_interface.handshake.modes import Arming
from station.channel.line import PackmlState

PATIENCE_S = 60


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--count", "3"), 1, "station: the line was ended after 0 of 3 fruits; start it anew for the others\n"),
        ((), 0, ""),
    ],
)
def test_fruits_that_are_missing_are_told_by_the_exit_code(number, arguments, code, message):
    with socket.create_server(("127.0.0.1", 0)) as station:
        station.settimeout(PATIENCE_S)
        environment = {**os.environ, "STATION_MODBUS_PORT": str(station.getsockname()[1])}
        command = [sys.executable, "-m", "station", "line", *arguments]
        with subprocess.Popen(command, stdout=-1, stderr=-1, text=True, env=environment) as line:
            connection, _ = station.accept()  # a station that sends nothing
            line.send_signal(number)
            shown, errors = line.communicate(timeout=PATIENCE_S)
            connection.close()
    assert (line.returncode, errors) == (code, message)
    assert "0 fruits" in shown


def test_a_line_that_has_ended_is_not_missed_as_a_lost_plc(serve):
    async def main():
        async with serve() as rig:
            rig.packml_state = PackmlState.IDLE
            environment = {**os.environ, "STATION_MODBUS_PORT": str(rig.port)}
            command = (sys.executable, "-m", "station", "line", "--count", "1")
            line = await asyncio.create_subprocess_exec(*command, env=environment, stdout=-1)
            async with asyncio.timeout(PATIENCE_S):
                await line.communicate()
                while rig.state.writer:
                    await asyncio.sleep(0.01)
            return line.returncode, rig.state.arming

    assert asyncio.run(main()) == (0, Arming.RELEASED)
