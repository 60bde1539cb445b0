"""Clients that others wrote, each where its toolchain is on this machine."""

import asyncio
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import pytest
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.pdu.mei_message import ReadDeviceInformationResponse

from plc_interface.server.write_lock import WriterChange
from tests.tools import missing, optional, required

CLIENTS = Path(__file__).parent / "clients"
FETCHED = Path(tempfile.gettempdir()) / f"fruit-station-clients-{os.getuid()}"
"""Packages from npm, Go's proxy and Maven, cached from one run to the next."""
FETCH_S, RUN_S = 60, 60


def run(*command: object, cwd: Path | None = None, timeout_s: float = RUN_S) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "CGO_ENABLED": "0", "GOCACHE": str(FETCHED / "go-build")}
    parts = [str(part) for part in command]
    return subprocess.run(
        parts, capture_output=True, text=True, timeout=timeout_s, check=False, cwd=cwd, env=environment
    )


def fetched(what: str, *command: object, cwd: Path) -> None:
    """Fetch or build a package of others, or skip with the last words of what could not."""
    try:
        done = run(*command, cwd=cwd, timeout_s=FETCH_S)
    except subprocess.TimeoutExpired:
        pytest.skip(f"{what} was not there in {FETCH_S} s")
    if done.returncode:
        pytest.skip(f"{what} is not there: {(done.stderr or done.stdout).strip()[-200:]}")


def saw(serving, trigger_id: int) -> None:
    """The server received what the client wrote, and noticed its coming and going."""
    serving.wait(lambda: serving.server.writer is None)
    assert {"control": 1, "trigger_id": trigger_id} in serving.writes
    assert [change for _, change in serving.changes] == [WriterChange.CLAIMED, WriterChange.DISCONNECTED]


def test_pymodbus(serve):
    serving = serve()

    async def talk() -> None:
        async with AsyncModbusTcpClient("127.0.0.1", port=serving.settings.port, timeout=20) as plc:
            assert (await plc.read_holding_registers(244, count=2)).registers == [0x1234, 0x5678]
            await plc.write_register(26, 0x5AFE)
            await plc.write_registers(0, [1, 76])
            done = await plc.readwrite_registers(read_address=0, read_count=2, write_address=2, values=[0, 9])
            assert done.registers == [1, 76]
            assert (await plc.read_input_registers(60)).exception_code == 2
            identity = await plc.read_device_information(read_code=2)
            assert isinstance(identity, ReadDeviceInformationResponse)
            assert identity.information[0] == b"fruit-station"

    asyncio.run(talk())
    saw(serving, 76)


def test_mbpoll(serve, mbpoll):
    serving = serve()

    def poll(*arguments: object) -> subprocess.CompletedProcess[str]:
        return run(mbpoll, "-m", "tcp", "-p", serving.settings.port, "-a", 1, "-0", "-1", "-q", "-o", 10, *arguments)

    read = poll("-t", "4:int", "-B", "-r", 244, "-c", 1, "127.0.0.1")
    assert "305419896" in read.stdout
    assert poll("-t", "4", "-r", 0, "127.0.0.1", 1, 75).returncode != 0
    assert poll("-t", "4", "-r", 26, "127.0.0.1", 0x5AFE).returncode == 0
    written = poll("-t", "4", "-r", 0, "127.0.0.1", 1, 75)
    assert "Written 2 references" in written.stdout
    assert {"control": 1, "trigger_id": 75} in serving.writes
    flags = poll("-t", "0", "-r", 0, "-c", 2, "127.0.0.1")
    assert [line.split() for line in flags.stdout.splitlines() if line.startswith("[")] == [
        ["[0]:", "1"],
        ["[1]:", "0"],
    ]
    assert "Illegal data address" in poll("-t", "4", "-r", 60, "-c", 1, "127.0.0.1").stderr


def test_libmodbus(serve, tmp_path):
    compiler = required("cc")
    if not Path("/usr/include/modbus/modbus.h").exists():
        missing("libmodbus-dev")
    program = tmp_path / "client"
    source = CLIENTS / "libmodbus_client.c"
    built = run(compiler, "-Wall", "-Wextra", "-Werror", "-I/usr/include/modbus", "-o", program, source, "-lmodbus")
    assert not built.returncode, built.stderr
    serving = serve()
    done = run(program, "127.0.0.1", serving.settings.port)
    assert not done.returncode, done.stderr
    saw(serving, 77)


def test_modbus_serial_with_parallel_requests(serve):
    node, npm = optional("node"), optional("npm")
    folder = FETCHED / "npm"
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / "node_modules" / "modbus-serial").exists():
        options = ("--silent", "--no-audit", "--no-fund", "--ignore-scripts")
        fetched("modbus-serial", npm, "install", *options, "--prefix", folder, "modbus-serial@8", cwd=folder)
    shutil.copy(CLIENTS / "parallel.js", folder)
    serving = serve()
    done = run(node, folder / "parallel.js", "127.0.0.1", serving.settings.port)
    assert not done.returncode, done.stderr
    saw(serving, 79)


def test_simonvetter_modbus(serve):
    go = optional("go")
    folder = FETCHED / "go"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(CLIENTS / "client.go", folder)
    (folder / "go.mod").write_text("module client\n\ngo 1.21\n")
    fetched("simonvetter/modbus", go, "get", "github.com/simonvetter/modbus@v1.6.3", cwd=folder)
    fetched("a build of it", go, "build", "-o", folder / "client", ".", cwd=folder)
    serving = serve()
    done = run(folder / "client", f"127.0.0.1:{serving.settings.port}")
    assert not done.returncode, done.stderr
    saw(serving, 80)


def test_j2mod(serve):
    java, mvn = optional("java"), optional("mvn")
    folder = FETCHED / "java"
    folder.mkdir(parents=True, exist_ok=True)
    if not list(folder.glob("j2mod-*.jar")):
        options = ("-q", "-B", f"-DoutputDirectory={folder}")
        fetched("j2mod", mvn, *options, "-f", CLIENTS / "pom.xml", "dependency:copy-dependencies", cwd=folder)
    serving = serve()
    done = run(java, "-cp", f"{folder}/*", CLIENTS / "Client.java", "127.0.0.1", serving.settings.port)
    assert not done.returncode, done.stderr
    saw(serving, 81)
