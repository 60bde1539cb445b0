"""Latency and CPU of the line's CAN: the gate's confirmation by the driver beside a bare python-can exchange.

The twin's nodes run in a process of their own, reached by udp_multicast; a real bus at 250 kbit/s adds about 0.5 ms for
each frame. Prints the table and writes it into docs/plc/can.md.
"""

import asyncio
import multiprocessing
import os
import platform
import socket
import statistics
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path

import can

from plc_interface.outputs.can.counts import further
from plc_interface.outputs.can.errors import LateRejectError
from plc_interface.outputs.can.line_io import LineIo
from plc_interface.outputs.can.link import ORDER, REPORT, open_bus
from station.settings.can import CanSettings
from station.twin.can.faults import line_faults
from station.twin.can.line import LineNodes
from station.twin.clock import SteadyClock

SHOTS = 200
AHEAD_COUNTS = 450
IDLE_S = 10.0
DEADLINE_S = 30.0
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "plc" / "can.md"
BEGIN, END = "<!-- bench can: begin -->", "<!-- bench can: end -->"


async def serve(settings: CanSettings, pipe: Connection) -> None:
    """Run the nodes until they are ended."""
    nodes = LineNodes(settings, SteadyClock(), line_faults())
    await nodes.start()
    pipe.send("ready")
    await asyncio.to_thread(pipe.recv)
    await nodes.stop()


def run_twin(settings: CanSettings, pipe: Connection) -> None:
    """The twin's process."""
    asyncio.run(serve(settings, pipe))


def exchange(bus: can.BusABC, settings: CanSettings, sequence: int) -> float:
    """Order a shot that is late by hand and wait for the gate's answer; in seconds."""
    order = ORDER.pack(sequence, 1, settings.pulse_ms, 0)
    answer = 0x180 + settings.gate_node
    began_s = time.perf_counter()
    bus.send(can.Message(arbitration_id=0x200 + settings.gate_node, data=order, is_extended_id=False))
    while time.perf_counter() - began_s < DEADLINE_S:
        message = bus.recv(1.0)
        if message and message.arbitration_id == answer and REPORT.unpack(message.data)[0] == sequence:
            return time.perf_counter() - began_s
    raise TimeoutError("the gate does not answer")


def bare(settings: CanSettings) -> list[float]:
    """The exchanges of a client with nothing around it; the driver keeps the gate operational meanwhile."""
    with open_bus(settings) as bus:
        return [exchange(bus, settings, 50_000 + number) for number in range(SHOTS)]


async def measure(settings: CanSettings) -> list[list[str]]:
    """Both clients in turn, and what the driver costs while nothing happens."""
    io = LineIo(settings)
    began_s = time.perf_counter()
    await io.start()
    try:
        async with asyncio.timeout(DEADLINE_S):
            io.renew_health(600)
            while not io.ready:
                await asyncio.sleep(0.005)
        up_s = time.perf_counter() - began_s
        busy_s = time.process_time()
        await asyncio.sleep(IDLE_S)
        busy = (time.process_time() - busy_s) / IDLE_S
        shots_s, missed = [], 0
        for sequence in range(1, SHOTS + 1):
            count = io.encoder_count()
            if count is None:
                raise TimeoutError("the encoder is silent")
            try:
                shots_s.append((await io.divert(sequence, 1, further(count, AHEAD_COUNTS))).confirmed_s)
            except LateRejectError:  # this machine stood still for longer than the belt took
                missed += 1
        bare_s = await asyncio.to_thread(bare, settings)
    finally:
        await io.stop()
    return [
        ["`LineIo.divert`, order to confirmation", *spread(shots_s)],
        ["bare python-can, order to answer", *spread(bare_s)],
        ["driver, start to ready", "", "", f"{1e3 * up_s:.0f}"],
        ["driver, CPU per second while idle", "", "", f"{1e3 * busy:.0f}"],
        [f"orders 150 ms ahead that came late: {missed} of {SHOTS}", "", "", ""],
    ]


def spread(times_s: list[float]) -> list[str]:
    """Median, 99th percentile and maximum in ms."""
    percentiles = statistics.quantiles(times_s, n=100)
    return [f"{1e3 * value:.2f}" for value in (percentiles[49], percentiles[98], max(times_s))]


def main() -> int:
    """Measure, print, and put the table into the document."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        port = probe.getsockname()[1]
    settings = CanSettings(
        enabled=True, port=port, heartbeat_lost_s=3.0, count_stale_s=1.0, echo_deadline_s=3.0, tolerance_counts=100_000
    )
    context = multiprocessing.get_context("spawn")
    near, far = context.Pipe()
    process = context.Process(target=run_twin, args=(settings, far))
    process.start()
    try:
        near.recv()
        rows = asyncio.run(measure(settings))
    finally:
        near.send("end")
        process.join()
    lines = [["what", "p50, ms", "p99, ms", "max, ms"], ["---"] * 4, *rows]
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    text += f"\n\n{SHOTS} actuations each, encoder at 100 Hz; {platform.machine()}, "
    text += f"Python {platform.python_version()}; load average of the machine {os.getloadavg()[0]:.1f} "
    text += f"on {os.cpu_count()} cores."
    print(text)
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    DOCUMENT.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
