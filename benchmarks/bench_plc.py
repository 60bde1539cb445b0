"""Speed of the PLC server: latency at a 10 ms scan and closed-loop throughput, alone and while vision works.

Our server beside a stock pymodbus server and one on libmodbus, asked for the same 20 registers by the same client
program. Run with `./run bench plc [SECONDS]`; needs gcc and libmodbus-dev. Writes its tables into
`docs/plc/latency.md`.
"""

import asyncio
import logging
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import NamedTuple

import psutil
from monitoring.ports import free_port

from plc_interface.process.real_time import request_real_time_priority
from plc_interface.server import connection
from plc_interface.server.image import RegisterImage
from plc_interface.server.server import ModbusServer
from station.settings.modbus import ModbusSettings

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "docs" / "plc" / "latency.md"
BEGIN, END = "<!-- bench plc: begin -->", "<!-- bench plc: end -->"
HOST = "127.0.0.1"
CLIENTS = (1, 8, 32)
SCAN_US = 10_000
ROUNDS = 3
DURATION_S = 3.0
_UNLIMITED_PER_S = 10**9
OURS, PLAIN, STOCK, LIBMODBUS = "this server", "this server, ordinary priority", "stock pymodbus", "libmodbus (C)"


class Figures(NamedTuple):
    """Measurements of one run of the client program."""

    replies_per_s: float
    p50_us: float
    p99_us: float
    worst_us: float


def serve_ours(port: int, *, priority: bool) -> None:
    """Our server, as its process runs it, but for a connection's limit, which would hide what a closed loop shows."""
    logging.disable(logging.CRITICAL)
    connection.REQUESTS_PER_S = _UNLIMITED_PER_S  # pyrefly: ignore[bad-assignment] (a constant)

    async def serve() -> None:
        most = 2 * max(CLIENTS)
        settings = ModbusSettings(port=port, max_connections=most, max_per_address=most)
        await ModbusServer(settings, RegisterImage(), lambda *_: None, lambda *_: None).start()
        if priority:
            request_real_time_priority()
        await asyncio.Event().wait()

    asyncio.run(serve())


def serve_stock(port: int) -> None:
    """Pymodbus as its documentation builds a server."""
    from pymodbus.server import StartAsyncTcpServer  # noqa: PLC0415
    from pymodbus.simulator import DataType, SimData, SimDevice  # noqa: PLC0415

    logging.disable(logging.CRITICAL)
    device = SimDevice(1, [SimData(0, count=512, values=0, datatype=DataType.REGISTERS)])
    asyncio.run(StartAsyncTcpServer(device, address=(HOST, port)))


def work_on_images() -> None:
    """The robust method on a simulated image over and over, with as many threads as it is given: cores - 1."""
    import cv2  # noqa: PLC0415

    from station.settings.segmentation import RobustParameters  # noqa: PLC0415
    from station.twin.digit.press import render_press  # noqa: PLC0415
    from station.vision.robust import RobustMethod  # noqa: PLC0415

    cv2.setNumThreads(max(1, (os.cpu_count() or 2) - 1))
    press = render_press("raspberry", 1, [3.0])
    method = RobustMethod(press.references[0], RobustParameters())
    while True:
        method.measure(press.frames[0])


def built(name: str, folder: Path, *libraries: str) -> Path:
    """A C program of this benchmark."""
    program = folder / name
    source = ROOT / "benchmarks" / "plc" / f"{name}.c"
    subprocess.run(["gcc", "-O2", "-I/usr/include/modbus", "-o", program, source, *libraries], check=True)
    return program


def wait_for(port: int) -> None:
    """Until a server listens."""
    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        with socket.socket() as probe:
            if probe.connect_ex((HOST, port)) == 0:
                return
        time.sleep(0.05)
    raise TimeoutError(f"nobody listens on port {port}")


def measured(load: Path, port: int, clients: int, scan_us: int, duration_s: float) -> Figures:
    """One run of the client program."""
    command = [str(load), HOST, str(port), str(clients), str(duration_s), str(scan_us)]
    printed = subprocess.run(command, capture_output=True, text=True, check=True, timeout=10 * duration_s + 30)
    return Figures(*map(float, printed.stdout.split()))


def middle(runs: list[Figures]) -> Figures:
    """Each figure's median."""
    return Figures(*(sorted(figures)[len(runs) // 2] for figures in zip(*runs, strict=True)))


def all_measured(load: Path, ports: dict[str, int], duration_s: float) -> dict[tuple[str, int, int], Figures]:
    """By server, number of clients and scan time; the servers in turn, so that all see the same weather."""
    runs: dict[tuple[str, int, int], list[Figures]] = {}
    for _ in range(ROUNDS):
        for clients in CLIENTS:
            for scan_us in (SCAN_US, 0):
                for name, port in ports.items():
                    figures = measured(load, port, clients, scan_us, duration_s)
                    runs.setdefault((name, clients, scan_us), []).append(figures)
    return {key: middle(each) for key, each in runs.items()}


def latency_table(idle: dict[tuple[str, int, int], Figures], busy: dict[tuple[str, int, int], Figures]) -> str:
    """Microseconds at a 10 ms scan."""
    lines = [
        "| server | clients | idle p50 | idle p99 | idle worst | vision p50 | vision p99 | vision worst |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for (name, clients, scan_us), alone in idle.items():
        if scan_us:
            loaded = busy[name, clients, scan_us]
            cells = [f"{us:,.0f}" for us in (*alone[1:], *loaded[1:])]
            lines.append(f"| {name} | {clients} | {' | '.join(cells)} |")
    return "\n".join(lines)


def throughput_table(idle: dict[tuple[str, int, int], Figures], busy: dict[tuple[str, int, int], Figures]) -> str:
    """Replies per second in a closed loop."""
    lines = ["| server | clients | idle | beside vision |", "|---|---|---|---|"]
    for (name, clients, scan_us), alone in idle.items():
        if not scan_us:
            lines.append(
                f"| {name} | {clients} | {alone.replies_per_s:,.0f} | {busy[name, clients, 0].replies_per_s:,.0f} |"
            )
    return "\n".join(lines)


def verdict(idle: dict[tuple[str, int, int], Figures], busy: dict[tuple[str, int, int], Figures]) -> str:
    """Return a table of the requirements and the measured values, for one PLC and for 32 clients."""
    alone, loaded = idle[OURS, 1, SCAN_US].p99_us, busy[OURS, 1, SCAN_US].p99_us
    stock = busy[STOCK, 1, SCAN_US].p99_us
    ratio = idle[PLAIN, 32, 0].replies_per_s / idle[STOCK, 32, 0].replies_per_s
    return "\n".join(
        [
            "| wanted | measured |",
            "|---|---|",
            f"| p99 beside vision at most 2 times this server's idle | {loaded / alone:.1f} times |",
            f"| p99 beside vision below stock pymodbus | {loaded:,.0f} µs, stock {stock:,.0f} µs |",
            f"| throughput with 32 clients at least 1.5 times stock | {ratio:.1f} times, both at ordinary priority |",
        ]
    )


def conditions(duration_s: float, others: float) -> str:
    """Under which circumstances this was measured."""
    return (
        f"Medians of {ROUNDS} runs of {duration_s:g} s each, 20 registers a request; pymodbus {version('pymodbus')}, "
        f"Python {sys.version.split()[0]}, {os.cpu_count()} cores, of which other programs took {others:.0f} % before "
        "the run."
    )


def main(duration_s: float) -> int:
    """Measure, print and write."""
    os.environ["OMP_NUM_THREADS"] = "1"
    context = multiprocessing.get_context("spawn")
    ports = {name: free_port() for name in (OURS, PLAIN, STOCK, LIBMODBUS)}
    others_before = psutil.cpu_percent(1.0)

    def start(target: Callable[..., None], *arguments: object, **options: object) -> SpawnProcess:
        process = context.Process(target=target, args=arguments, kwargs=options, daemon=True)
        process.start()
        return process

    with tempfile.TemporaryDirectory() as folder:
        load = built("load", Path(folder))
        peer = subprocess.Popen([built("libmodbus_server", Path(folder), "-lmodbus"), HOST, str(ports[LIBMODBUS])])
        servers = [
            start(serve_ours, ports[OURS], priority=True),
            start(serve_ours, ports[PLAIN], priority=False),
            start(serve_stock, ports[STOCK]),
        ]
        try:
            for port in ports.values():
                wait_for(port)
            idle = all_measured(load, ports, duration_s)
            vision = start(work_on_images)
            time.sleep(5.0)
            busy = all_measured(load, ports, duration_s)
            vision.kill()
        finally:
            peer.kill()
            peer.wait()
            for server in servers:
                server.kill()
    written = "\n\n".join(
        [
            verdict(idle, busy),
            f"Latency at a 10 ms scan, µs:\n\n{latency_table(idle, busy)}",
            f"Closed loop, replies per second:\n\n{throughput_table(idle, busy)}",
            conditions(duration_s, others_before),
        ]
    )
    print(written)
    head, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    _, _, tail = rest.partition(END)
    DOCUMENT.write_text(f"{head}{BEGIN}\n{written}\n{END}{tail}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(float(sys.argv[1]) if len(sys.argv) > 1 else DURATION_S))
