"""Latency of the gripper's wires: the station's drivers beside a bare pymodbus client and pyRobotiqGripper.

All of them use one twin in a process of its own, one after the other, so the figures are those of the software, not
of RS-485 or of a robot's network. Prints the table and writes it into docs/gripper.md.
"""

import asyncio
import multiprocessing
import platform
import statistics
import sys
import time
from collections.abc import Awaitable, Callable
from multiprocessing.connection import Connection
from pathlib import Path

import pyrobotiqgripper
from pymodbus.client import AsyncModbusTcpClient
from pymodbus.framer import FramerType

from station.devices.gripper.robotiq import make_gripper
from station.settings.gripper import GripperSettings, ModbusRtuSettings, UrcapSettings
from station.twin.clock import SteadyClock
from station.twin.robotiq.faults import gripper_faults
from station.twin.robotiq.load import Spring
from station.twin.robotiq.modbus import RtuOverTcpServer, RtuSerialServer
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.urcap import UrcapServer

READS = 1000
STEPS_MM = range(46, 32, -1)
ROUNDS = 5
SPEED_MM_S, FORCE_N = 150.0, 20.0
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "gripper.md"
BEGIN, END = "<!-- bench gripper: begin -->", "<!-- bench gripper: end -->"

Read = Callable[[], Awaitable[object]]
Step = Callable[[float], Awaitable[object]]


def count_for(width_mm: float) -> int:
    """Return the gripper's count for a width beside the DIGIT, which a bare client has to compute itself."""
    return round(230 - (width_mm + 32.0) * 227 / 85)


async def twin(pipe: Connection) -> None:
    """Serve one gripper with a soft load on three wires until it is ended."""
    gripper = RobotiqGripper(SteadyClock(), gripper_faults(), Spring(free_mm=76.0, stiffness_n_per_mm=1.0))
    urcap, tcp, serial = UrcapServer(gripper, port=0), RtuOverTcpServer(gripper, port=0), RtuSerialServer(gripper)
    for server in (urcap, tcp, serial):
        await server.start()
    pipe.send((urcap.port, tcp.port, serial.path))
    await asyncio.to_thread(pipe.recv)
    for server in (urcap, tcp, serial):
        await server.stop()


def run_twin(pipe: Connection) -> None:
    """The twin's process."""
    asyncio.run(twin(pipe))


async def measured(name: str, read: Read, step: Step) -> list[str]:
    """One row: round trip of a status read, and whole steps of a millimetre."""
    trips_s = []
    busy_s = time.process_time()
    for _ in range(READS):
        began_s = time.perf_counter()
        await read()
        trips_s.append(time.perf_counter() - began_s)
    busy_s = time.process_time() - busy_s
    steps_s = []
    for _ in range(ROUNDS):
        await step(47.0)
        for width_mm in STEPS_MM:
            began_s = time.perf_counter()
            await step(width_mm)
            steps_s.append(time.perf_counter() - began_s)
    percentiles = statistics.quantiles(trips_s, n=100)
    return [
        name,
        f"{1e3 * percentiles[49]:.2f}",
        f"{1e3 * percentiles[98]:.2f}",
        f"{1e3 * busy_s / READS:.2f}",
        f"{1e3 * statistics.median(steps_s):.1f}",
        f"{1 / statistics.mean(steps_s):.0f}",
    ]


async def driver_row(name: str, settings: GripperSettings) -> list[str]:
    """One of the station's drivers."""
    gripper = make_gripper(settings)
    try:
        await gripper.activate()
        return await measured(name, gripper.read, lambda width: gripper.move_to_width(width, SPEED_MM_S, FORCE_N))
    finally:
        await gripper.close()


async def bare_row(port: int) -> list[str]:
    """A pymodbus client with nothing around it."""
    client = AsyncModbusTcpClient("127.0.0.1", port=port, framer=FramerType.RTU)
    await client.connect()

    async def read() -> object:
        return await client.read_input_registers(2000, count=3, device_id=9)

    async def step(width_mm: float) -> object:
        await client.write_registers(1000, [0x0900, count_for(width_mm), 0xFF00], device_id=9)
        while True:
            status = await client.read_input_registers(2000, count=3, device_id=9)
            if status.registers[0] >> 14:
                return status
            await asyncio.sleep(0.005)

    try:
        return await measured("bare pymodbus client, RTU over TCP", read, step)
    finally:
        client.close()


async def foreign_row(port: int) -> list[str]:
    """pyRobotiqGripper, which blocks and polls without a pause."""
    gripper = pyrobotiqgripper.RobotiqGripper(
        connection_type=pyrobotiqgripper.GRIPPER_MODE_RTU_VIA_TCP, tcp_host="127.0.0.1", tcp_port=port
    )
    gripper.activate(reset=False)

    async def read() -> object:
        return gripper.readStatus()

    async def step(width_mm: float) -> object:
        return gripper.move(count_for(width_mm), speed=255, force=0)

    try:
        return await measured("pyRobotiqGripper, RTU over TCP", read, step)
    finally:
        gripper.disconnect()


async def rows(urcap: int, tcp: int, serial: str) -> list[list[str]]:
    """Every client in turn."""
    over_tcp = ModbusRtuSettings(line="tcp", host="127.0.0.1", port=tcp)
    over_serial = ModbusRtuSettings(serial_port=serial)
    return [
        await driver_row("`urcap`", GripperSettings(urcap=UrcapSettings(host="127.0.0.1", port=urcap))),
        await driver_row("`modbus_rtu`, RTU over TCP", GripperSettings(driver="modbus_rtu", modbus_rtu=over_tcp)),
        await driver_row("`modbus_rtu`, serial (pty)", GripperSettings(driver="modbus_rtu", modbus_rtu=over_serial)),
        await bare_row(tcp),
        await foreign_row(tcp),
    ]


def table(measurements: list[list[str]]) -> str:
    """The rows as Markdown."""
    head = ["client", "status p50, ms", "status p99, ms", "CPU per status, ms", "1 mm step p50, ms", "steps/s"]
    lines = [head, ["---"] * len(head), *measurements]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> int:
    """Measure, print, and put the table into the document."""
    context = multiprocessing.get_context("spawn")
    near, far = context.Pipe()
    process = context.Process(target=run_twin, args=(far,))
    process.start()
    try:
        measurements = asyncio.run(rows(*near.recv()))
    finally:
        near.send("end")
        process.join()
    text = (
        f"{table(measurements)}\n\n"
        f"{READS} status reads and {ROUNDS * len(STEPS_MM)} steps at {SPEED_MM_S:g} mm/s each; "
        f"{platform.machine()}, Python {platform.python_version()}. Of a step 6.7 ms are travel at that speed."
    )
    print(text)
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    DOCUMENT.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
