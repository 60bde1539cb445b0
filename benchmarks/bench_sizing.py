"""Sizing of a station's machine: cores, memory and disk by process and fruit, and the effect of pinning.

Run with `./run bench sizing [FRUITS]`. Writes the table of `docs/sizing.md`.
"""

import asyncio
import os
import shutil
import sqlite3
import statistics
import sys
import tempfile
import time
from collections.abc import Awaitable
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import psutil
from bench_plc import built
from bench_soak import WINDOW_S, latency
from soak.samples import Latency

from plc_interface.plc_simulator.nest import TwinNest
from plc_interface.plc_simulator.program import LineProgram
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.commands.simulated_unit import calibrate_simulated_unit
from station.settings.configuration import Configuration, load_configuration
from station.settings.recipe import load_recipes
from station.supervision.programs import station_programs, twin_program
from station.supervision.supervisor import Supervisor

IDLE_S, SEED, HOURS = 20.0, 2026, 16
KINDS = ("strawberry", "raspberry", "blueberry")
CONSOLE_PORT, HOST = 49_341, "127.0.0.87"
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "sizing.md"
BEGIN, END = "<!-- measured: made by ./run bench sizing -->\n", "<!-- end of measured -->\n"
CONFIGURATION = f"""
modbus: {{port: 5941}}
metrics: {{port: 9841}}
hmi: {{port: 8841}}
records: {{accepted_share: 1.0}}
arm: {{host: {HOST}, stale_after_s: 1.0, link_lost_after_s: 5.0}}
gripper: {{urcap: {{host: {HOST}}}, modbus_rtu: {{host: {HOST}}}, answer_timeout_s: 1.0}}
camera: {{oldest_s: 1.0, twin: {{port: 5942}}}}
"""
NAMES = {"twin": "twin (not of a real station)", "service": "service, with the arm's driver", "plc": "PLC interface"}


class Use(NamedTuple):
    """CPU time and memory that one of the station's processes has taken, with those that it started."""

    cpu_s: float
    resident_mb: float


class Phase(NamedTuple):
    """A part of the run."""

    wall_s: float
    cpu_s: dict[str, float]
    resident_mb: dict[str, float]
    replies: list[Latency]


def children() -> dict[str, psutil.Process]:
    """The station's processes, by the first word of their command."""
    found = {}
    for process in psutil.Process().children():
        words = process.cmdline()
        if "station" in words:
            found[words[words.index("station") + 1]] = process
    return found


def use() -> dict[str, Use]:
    """Of each of them by now."""
    found = {}
    for name, process in children().items():
        family = [process, *process.children(recursive=True)]
        cpu_s = sum(sum(each.cpu_times()[:2]) for each in family)
        found[name] = Use(cpu_s, sum(each.memory_info().rss for each in family) / 1e6)
    return found


def pin() -> None:
    """The PLC's server alone on the last core, all others on the rest."""
    cores = list(range(os.cpu_count() or 1))
    for name, process in children().items():
        for each in (process, *process.children(recursive=True)):
            each.cpu_affinity(cores[-1:] if name == "plc" else cores[:-1] or cores)


async def phase(site: Configuration, load: Path, work: Awaitable[object]) -> Phase:
    """Measure while something is done; `load` is the client that measures the PLC's replies."""
    ended, replies = asyncio.Event(), list[Latency]()

    async def measure_replies() -> None:
        while not ended.is_set():
            if (found := await latency(load, site.modbus.port, ended)) is not None:
                replies.append(found)
        if not replies:  # of so few fruit that no window was over
            only = await latency(load, site.modbus.port, asyncio.Event())
            if only is None:
                raise SystemExit("the PLC interface gave no reply; see its log")
            replies.append(only)

    before, began_s = use(), time.monotonic()
    measuring = asyncio.create_task(measure_replies())
    await work
    after, wall_s = use(), time.monotonic() - began_s
    ended.set()
    await measuring
    cpu_s = {name: after[name].cpu_s - before[name].cpu_s for name in before}
    return Phase(wall_s, cpu_s, {name: each.resident_mb for name, each in after.items()}, replies)


async def measure(site: Configuration, load: Path, count: int) -> dict[str, Phase]:
    """Idle, inspecting, and inspecting pinned."""
    numbers = {name: recipe.plc_number for name, recipe in load_recipes(site.recipes_folder).items()}
    nest = TwinNest(CONSOLE_PORT, {kind: numbers[kind] for kind in KINDS}, 0.25, SEED)
    logs = site.home / "logs"
    logs.mkdir()
    supervisor = Supervisor([twin_program(None, CONSOLE_PORT, SEED, logs), *station_programs(None, logs)])
    ended, ready = asyncio.Event(), asyncio.Event()
    supervising = asyncio.create_task(supervisor.run(ready.set, ended))
    phases: dict[str, Phase] = {}
    try:
        async with asyncio.timeout(180):
            await ready.wait()
        phases["idle"] = await phase(site, load, asyncio.create_task(asyncio.sleep(IDLE_S)))
        for name in ("inspecting", "pinned"):
            if name == "pinned":
                pin()
            order = WordOrder(site.modbus.word_order)
            async with Scanner(site.modbus.host, site.modbus.port, site.modbus.unit, order) as scanner:
                simulator = LineSimulator(LineProgram(lot="BENCH"), scanner, nest, Pace())
                phases[name] = await phase(site, load, asyncio.create_task(simulator.run(count)))
            print(name, "done", file=sys.stderr)
    finally:
        ended.set()
        await supervising
    return phases


def disk(home: Path, count: int) -> tuple[float, float, float]:
    """For a fruit, kB of the database and of images; and MB of a database that is empty."""
    path = home / "records" / "records.sqlite3"
    with closing(sqlite3.connect(path)) as connection:
        total = path.stat().st_size
        images = connection.execute("SELECT count(DISTINCT sequence) FROM images").fetchone()[0]
        connection.executescript("PRAGMA foreign_keys = ON; DELETE FROM images; DELETE FROM inspections; VACUUM")
    files = sum(file.stat().st_size for file in (home / "records" / "images").rglob("*.png"))
    empty = path.stat().st_size
    return (total - empty) / count / 1e3, files / max(1, images) / 1e3, empty / 1e6


def written(phases: dict[str, Phase], sizes: tuple[float, float, float], count: int) -> str:
    """The tables."""
    idle, busy = phases["idle"], phases["inspecting"]
    ours = [name for name in busy.cpu_s if name != "twin"]
    rows = [(NAMES.get(name, "pages"), (name,)) for name in ("service", "plc", "hmi", "twin")]
    seconds = busy.wall_s / count
    parts = [
        f"{count} fruits on the twin, one after the other ({seconds:.1f} s each), and as many again with the PLC",
        f" interface alone on one core; {os.cpu_count()} cores, load {os.getloadavg()[1]:.1f}. A client in C",
        " reads registers every 10 ms meanwhile. Shares are of one core.\n\n",
        _head("process", "idle", "inspecting", "CPU a fruit, s", "memory, MB"),
    ]
    for words, names in (*rows, ("the station", tuple(ours))):
        idle_s, busy_s = (sum(each.cpu_s[name] for name in names) for each in (idle, busy))
        memory_mb = sum(busy.resident_mb[name] for name in names)
        shares = f"{idle_s / idle.wall_s:.2f} | {busy_s / busy.wall_s:.2f}"
        parts.append(f"| {words} | {shares} | {busy_s / count:.2f} | {memory_mb:.0f} |\n")
    parts.append(
        "\n" + _head("the PLC's replies", "median, ms", "99 %, ms", "longest, ms", f"windows of {WINDOW_S:g} s")
    )
    for name, words in (("idle", "idle"), ("inspecting", "inspecting"), ("pinned", "inspecting, pinned")):
        replies = phases[name].replies
        middle, tail = (statistics.median(values) / 1e3 for values in list(zip(*replies, strict=True))[:2])
        longest = max(each.worst_us for each in replies) / 1e3
        parts.append(f"| {words} | {middle:.2f} | {tail:.2f} | {longest:.1f} | {len(replies)} |\n")
    parts.append("\n" + _head("on the disk", ""))
    parts.append(f"| a fruit's record | {sizes[0]:.1f} kB |\n")
    parts.append(f"| a fruit's images, where they are stored | {sizes[1] / 1e3:.1f} MB |\n")
    parts.append(f"| an empty database | {sizes[2]:.2f} MB |\n")
    daily, quota_mb = 60 * HOURS * 60 / seconds, Configuration().records.images_quota_mb
    parts.append(
        f"| records of a year, {HOURS} h a day, 300 days, at this pace | {300 * daily * sizes[0] / 1e6:.1f} GB |\n"
    )
    parts.append(f"| fruits whose images the quota of {quota_mb} MB holds | {1e3 * quota_mb / sizes[1]:.0f} |\n")
    return "".join(parts)


def _head(*names: str) -> str:
    return f"| {' | '.join(names)} |\n|{' --- |' * len(names)}\n"


def main() -> None:
    """Measure, and write the document's table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    home = Path(tempfile.mkdtemp(prefix="sizing-"))
    (home / "station.yaml").write_text(CONFIGURATION, encoding="utf-8")
    os.environ["STATION_HOME"] = str(home)
    try:
        site = load_configuration()
        calibrate_simulated_unit(site, "bench")
        phases = asyncio.run(measure(site, built("load", home), count))
        text = written(phases, disk(home, 2 * count), count)
    finally:
        shutil.rmtree(home)
    before, _, rest = DOCUMENT.read_text(encoding="utf-8").partition(BEGIN)
    DOCUMENT.write_text(f"{before}{BEGIN}{text}{END}{rest.partition(END)[2]}", encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
