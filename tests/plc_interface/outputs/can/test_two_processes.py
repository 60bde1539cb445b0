"""The twin in a process of its own, reached by multicast; its console, and the check for commissioning."""

import asyncio
import signal
import subprocess
import sys

import pytest
from click.testing import CliRunner

from plc_interface.outputs.can.command import check_can
from plc_interface.outputs.can.counts import further
from plc_interface.outputs.can.line_io import LineIo
from station.messages import can as messages
from station.settings.configuration import load_configuration
from station.twin.console import ask

LIMIT_S = 60.0
QUICK = "heartbeat_s: 0.05, heartbeat_lost_s: 2.0, answer_timeout_s: 2.0, retry_s: 0.05, count_stale_s: 2.0"
SLACK = "tolerance_counts: 1000000, echo_deadline_s: 2.0"


@pytest.fixture
def configuration(tmp_path, unused_port, multicast_port):
    file = tmp_path / "station.yaml"
    file.write_text(
        f"can: {{enabled: true, port: {multicast_port}, {QUICK}, {SLACK}}}\n"
        "gripper: {urcap: {host: 127.79.0.1}, modbus_rtu: {host: 127.79.0.1}}\n"
        f"camera: {{twin: {{host: 127.79.0.1, port: {unused_port}}}}}\n"
    )
    return file


@pytest.fixture
def console(configuration):
    """The console's port of a twin that runs on this configuration."""
    command = [sys.executable, "-m", "station", "twin", "--bench", "--console", "0", "--config", str(configuration)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    lines = {}
    for line in process.stdout:
        lines[line.split()[0].rstrip(";")] = line
        if line.startswith("running"):
            break
    assert "CAN udp_multicast 239.74.163.2: gate 16, encoder 17" in lines["line"]
    yield int(lines["console"].split(":")[1])
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)
    assert process.returncode == 0


def test_a_fruit_is_diverted_between_processes(configuration, console):
    async def scenario():
        io = LineIo(load_configuration(configuration, {}).can)
        await io.start()
        try:
            async with asyncio.timeout(LIMIT_S):
                io.renew_health(LIMIT_S)
                while not io.ready:
                    await asyncio.sleep(0.01)
                count = io.encoder_count()
                assert count is not None
                echo = await io.divert(9, 3, further(count, 3000))
                state = await asyncio.to_thread(ask, "127.0.0.1", console, {"do": "line"})
                assert state["fired"] == [{"sequence": 9, "lane": 3, "pulse_ms": 120, "at_count": echo.fired_count}]
                assert state["gate"] == "operational"
                fault = {"do": "set", "device": "line", "fault": "gate_silent"}
                await asyncio.to_thread(ask, "127.0.0.1", console, fault)
                while io.why_not_ready is None or io.why_not_ready.id != messages.SILENT.id:
                    await asyncio.sleep(0.01)
        finally:
            await io.stop()

    asyncio.run(scenario())


def test_the_check_says_who_is_there_and_what_is_wrong(configuration, console):
    def check():
        return CliRunner().invoke(check_can, ["--config", str(configuration)])

    sound = check()
    assert sound.exit_code == 0, sound.output
    interface, gate, encoder = sound.output.splitlines()
    assert interface.startswith("ok      the CAN interface udp_multicast 239.74.163.2 port ")
    assert gate.startswith(
        "ok      the reject gate (node 16): Reject gate 1.0, heartbeat pre-operational, another mapping"
    )
    assert encoder.startswith("ok      the line encoder (node 17): Line encoder 1.0")
    assert "count " in encoder
    ask("127.0.0.1", console, {"do": "set", "device": "line", "fault": "wrong_identity"})
    ask("127.0.0.1", console, {"do": "set", "device": "line", "fault": "encoder_silent"})
    faulty = check()
    assert faulty.exit_code == 1
    _, gate, encoder = faulty.output.splitlines()[:3]
    assert gate.startswith("fault   the reject gate (node 16) is another device: its product is 0x0BAD0BAD")
    assert encoder.startswith("fault   no heartbeat of the line encoder (node 17)")
    assert str(faulty.exception) == "not usable: the reject gate (node 16), the line encoder (node 17)"


def test_the_check_of_what_is_not_there(tmp_path):
    off = tmp_path / "off.yaml"
    off.write_text("can: {enabled: false}\n")
    done = CliRunner().invoke(check_can, ["--config", str(off)])
    assert (done.exit_code, done.output) == (0, "CAN is off, the line's PLC diverts; set can.enabled to use it\n")
    missing = tmp_path / "missing.yaml"
    missing.write_text("can: {enabled: true, interface: socketcan, channel: nocan7}\n")
    done = CliRunner().invoke(check_can, ["--config", str(missing)])
    assert done.exit_code == 1
    assert "the CAN interface socketcan nocan7 cannot be opened" in str(done.exception)


def test_the_twin_stays_off_a_real_bus(tmp_path, unused_port):
    file = tmp_path / "real.yaml"
    file.write_text(
        "can: {enabled: true, interface: socketcan, channel: can0}\n"
        "gripper: {urcap: {host: 127.79.0.2}, modbus_rtu: {host: 127.79.0.2}}\n"
        f"camera: {{twin: {{host: 127.79.0.2, port: {unused_port}}}}}\n"
    )
    command = [sys.executable, "-m", "station", "twin", "--bench", "--console", "0", "--config", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "CAN can0 is a real bus, where the twin has no business" in done.stderr
    assert "Traceback" not in done.stderr
