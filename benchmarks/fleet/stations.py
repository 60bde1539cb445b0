"""Whole stations side by side on one machine: each its twin, service, PLC interface, outbox and line."""

import asyncio
import dataclasses
import json
import os
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

from plc_interface.plc_simulator.nest import LaidFruit, TwinNest
from plc_interface.plc_simulator.program import Decision, LineProgram, Passage
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.commands.simulated_unit import calibrate_simulated_unit
from station.records.database import reading, records_folder
from station.settings.configuration import Configuration, load_configuration
from station.settings.recipe import load_recipes
from station.supervision.programs import station_programs, twin_program
from station.supervision.supervisor import Supervisor

UNWANTED = (str(Decision.REFUSED), str(Decision.NO_ANSWER), "late")
"""What no PLC may see."""
KIND = "blueberry"
"""The quickest of the shipped recipes to decide."""
DAMAGED_SHARE = 0.25
ARM_HZ = 50
"""Of each arm's state; 500 as in a cell would take the cores too."""
SCAN_S = 0.05
"""Of each PLC; a scan of 10 ms, as one station's line has it, would take the cores that the stations need."""
_START_LIMIT_S, _WATCHDOG_S = 300.0, 60.0
"""Sixty processes on two cores: one that starts waits for the others' imports."""


@dataclass
class Cell:
    """One station with its line."""

    name: str
    site: Configuration
    file: Path
    console_port: int
    seed: int
    passages: list[Passage] = field(default_factory=list)

    @property
    def metrics(self) -> str:
        """Address at which Prometheus scrapes the station, host and port."""
        return f"{self.site.metrics.host}:{self.site.metrics.port}"


def prepare(folder: Path, number: int, host: str, ports: Sequence[int], postgresql: Path) -> Cell:
    """Write a station's configuration, and calibrate its simulated sensor.

    Args:
        folder: of all stations.
        number: of this one.
        host: a loopback address of its own for the arm and the gripper, whose ports are fixed.
        ports: four free ones.
        postgresql: folder of the server's socket.
    """
    name = f"station-{number}"
    modbus, metrics, camera, console = ports
    # Nothing here moves a real arm, and what shares two cores with sixty processes may be late by more than in a cell.
    values = {
        "home": str(folder / name),
        "modbus": {"port": modbus},
        "metrics": {"port": metrics},
        "arm": {"host": host, "frequency_hz": ARM_HZ, "stale_after_s": 1.0, "link_lost_after_s": 5.0},
        "gripper": {"urcap": {"host": host}, "modbus_rtu": {"host": host}, "answer_timeout_s": 2.0},
        "camera": {"oldest_s": 2.0, "twin": {"port": camera}},
        "handshake": {"station_lost_after_s": 10.0, "begin_deadline_s": 5.0},
        "records": {"free_reserve_mb": 1},
        "outbox": {
            "station": name,
            "postgresql": {"enabled": True, "host": str(postgresql), "user": "fruit", "tls": "disable"},
        },
        "service": {"patience": 10.0, "inspection_deadline_s": None},
    }
    (folder / name).mkdir()
    file = folder / name / "station.yaml"
    file.write_text(json.dumps(values))
    site = load_configuration(file)
    calibrate_simulated_unit(site, "bench")
    return Cell(name, site, file, console, seed=number)


@asynccontextmanager
async def running(cells: Sequence[Cell]) -> AsyncIterator[None]:
    """Start the cells one after another; they are ready in the block, and end with it."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    ended = asyncio.Event()
    async with AsyncExitStack() as stack:
        for cell in cells:
            logs = cell.site.home / "logs"
            logs.mkdir()
            programs = [
                dataclasses.replace(program, start_limit_s=_START_LIMIT_S, watchdog_s=_WATCHDOG_S)
                for program in (
                    twin_program(cell.file, cell.console_port, cell.seed, logs),
                    *station_programs(cell.file, logs, outbox=True),
                )
                if program.name != "hmi"
            ]
            ready = asyncio.Event()
            supervising = asyncio.create_task(Supervisor(programs, environment).run(ready.set, ended))
            stack.push_async_callback(lambda task=supervising: asyncio.wait([task]))
            stack.callback(ended.set)
            async with asyncio.timeout(_START_LIMIT_S):
                await ready.wait()
        yield


async def inspect(cell: Cell, count: int, every_s: float, delay_s: float) -> None:
    """Run one cell's line; the passages are in the cell.

    Args:
        cell: which is running.
        count: of fruit.
        every_s: between two arrivals.
        delay_s: before the first.
    """
    modbus = cell.site.modbus
    number = load_recipes(cell.site.recipes_folder)[KIND].plc_number
    nest = TwinNest(cell.console_port, {KIND: number}, DAMAGED_SHARE, cell.seed)

    def passed(passage: Passage, _fruit: LaidFruit) -> None:
        cell.passages.append(passage)

    await asyncio.sleep(delay_s)
    async with Scanner(modbus.host, modbus.port, modbus.unit, WordOrder(modbus.word_order)) as scanner:
        simulator = LineSimulator(LineProgram(lot=f"L{cell.seed}"), scanner, nest, Pace(SCAN_S, every_s))
        simulator.on_passage = passed
        await simulator.run(count)


def at_plc(cell: Cell) -> Counter[str]:
    """Outcomes as the cell's PLC read them, and what it should never see: `refused`, `no answer`, `late`."""
    found = Counter(str(passage.decision) for passage in cell.passages)
    found["late"] = sum("late" in passage.reasons for passage in cell.passages)
    return +found


def recorded(cell: Cell) -> dict[int, str]:
    """Outcome of each inspection by its number, as the station's own records have it."""
    with reading(records_folder(cell.site.home)) as connection:
        rows = connection.exec_driver_sql("SELECT sequence, outcome FROM inspections").fetchall()
    return {row[0]: row[1] for row in rows}


def last_entry(cell: Cell) -> int:
    """The last entry that the station's records have for the outbox."""
    with reading(records_folder(cell.site.home)) as connection:
        return connection.exec_driver_sql("SELECT max(entry) FROM outbox").scalar_one()


def disagreements(
    cell: Cell, own: dict[int, str], arrived: Sequence[tuple[int, str]], counted: dict[str, int], wanted: int
) -> list[str]:
    """Return the differences between the PLC, the records, PostgreSQL and Prometheus, in words.

    Args:
        cell: the station with its line.
        own: its records, by `recorded`.
        arrived: number and outcome of each of its rows in PostgreSQL.
        counted: Prometheus' counts by outcome.
        wanted: number of fruit that its line had.
    """
    wrong = []
    seen = at_plc(cell)
    lost = {name: seen.pop(name) for name in UNWANTED if seen[name]}
    if lost:
        why = [f"{each.decision}: {', '.join(each.reasons)}" for each in cell.passages if not each.sequence]
        wrong.append(f"{cell.name}: the PLC saw {lost} {why}")
    if len(cell.passages) != wanted:
        wrong.append(f"{cell.name}: {len(cell.passages)} of {wanted} fruit decided")
    if seen != Counter(own.values()) or {each.sequence for each in cell.passages if each.sequence} != own.keys():
        wrong.append(f"{cell.name}: the PLC read {dict(seen)}, the records have {dict(Counter(own.values()))}")
    if sorted(arrived) != sorted(own.items()):
        wrong.append(f"{cell.name}: PostgreSQL has {sorted(arrived)}, the records {sorted(own.items())}")
    if counted != Counter(own.values()):
        wrong.append(f"{cell.name}: Prometheus counts {counted}, the records have {dict(Counter(own.values()))}")
    return wrong
