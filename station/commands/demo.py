"""`station demo`: the whole station with the simulated world and line, on the real protocols."""

import asyncio
import os
from pathlib import Path

import click
from rich.console import Console

from plc_interface.plc_simulator.display import LineDisplay, summary_line
from plc_interface.plc_simulator.faults import FaultPlan, LineFault
from plc_interface.plc_simulator.nest import SEVERITIES, TwinNest
from plc_interface.plc_simulator.program import LineProgram
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.commands.run import addresses
from station.commands.signals import on_end_signals
from station.commands.simulated_unit import calibrate_simulated_unit
from station.errors import BadInputError, StationError
from station.records.database import reading, records_folder
from station.records.queries import read_inspection
from station.records.texts import sparkline
from station.settings.configuration import Configuration, load_configuration
from station.settings.recipe import load_recipes
from station.supervision.programs import station_programs, twin_program
from station.supervision.supervisor import Supervisor

FRUITS = ("strawberry", "raspberry", "blueberry")
_LOT = "DEMO"
_FAULT_EVERY = 4
# A desktop computer is no real-time controller, and a slightly old state can harm no arm here.
_PATIENCE = {"stale_after_s": 0.5, "link_lost_after_s": 2.0}


@click.command("demo")
@click.option(
    "--fruit", "fruits", multiple=True, type=click.Choice(FRUITS), help="Kinds to draw from; may be repeated."
)
@click.option("--count", type=click.IntRange(min=1), metavar="N", help="End after N fruits; else Ctrl-C ends it.")
@click.option(
    "--speed", type=click.FloatRange(min=0, min_open=True, max=600), metavar="FRUITS",
    help="Fruits a minute at most; else as fast as the station takes them.",
)  # fmt: skip
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=1, show_default=True, help="Which fruits.")
@click.option("--damaged", type=click.FloatRange(0, 1), default=0.25, show_default=True, help="Share of damaged fruit.")
@click.option(
    "--severity", type=click.Choice(SEVERITIES), default=SEVERITIES[0], show_default=True, help="Of the damage."
)
@click.option("--console", default=49211, show_default=True, type=click.IntRange(1, 65535), help="The twin's console.")
@click.option("--grader/--no-grader", "graded", default=True, help="Whether the PLC sends each fruit's length.")
@click.option("--faults", is_flag=True, help=f"The PLC does something wrong at every {_FAULT_EVERY}th fruit.")
def demo(
    fruits: tuple[str, ...],
    count: int | None,
    speed: float | None,
    seed: int,
    damaged: float,
    severity: str,
    console: int,
    graded: bool,  # noqa: FBT001 (click passes arguments by name)
    faults: bool,  # noqa: FBT001
) -> None:
    """Run the station against the twin, with a line that feeds fruit, triggers, and reads the outcomes.

    Arm, gripper, sensor and PLC are simulated, the protocols between them are real: RTDE, the gripper's socket, camera
    frames and Modbus TCP. The first time, the simulated sensor is calibrated by a drawn ball, in a few seconds. Logs
    and records are in the home folder's `demo`.
    """
    asked = load_configuration()
    os.environ["STATION_HOME"] = str(asked.home.resolve() / "demo")
    for name in _PATIENCE.keys() - asked.arm.model_fields_set:
        os.environ[f"STATION_ARM_{name.upper()}"] = str(_PATIENCE[name])
    site = load_configuration()
    _refuse_real_devices(site)
    numbers = {name: recipe.plc_number for name, recipe in load_recipes(site.recipes_folder).items()}
    kinds = {name: numbers[name] for name in fruits or FRUITS}
    nest = TwinNest(console, kinds, damaged, seed, graded=graded, severity=severity)
    plan = FaultPlan(tuple(LineFault) if faults else (), _FAULT_EVERY)
    pace = Pace(every_s=60 / speed if speed else 0.0)
    new = calibrate_simulated_unit(site, "demo")
    if new is not None:
        click.echo(f"calibrated the simulated sensor by its drawn ball at three places: {new.summary()}")
    station = station_programs(None, _logs(site), clean_up_s=site.service.clean_up_deadline_s)
    supervisor = Supervisor([twin_program(None, console, seed, _logs(site)), *station])
    asyncio.run(_run(site, supervisor, nest, LineProgram(plan, _LOT), pace, count))


def _refuse_real_devices(site: Configuration) -> None:
    """Refuse a configuration of real devices: a demonstration must not move a real arm."""
    hosts = {
        "arm.host": site.arm.host,
        "gripper.urcap.host": site.gripper.urcap.host,
        "gripper.modbus_rtu.host": site.gripper.modbus_rtu.host,
        "camera.twin.host": site.camera.twin.host,
    }
    real = [f"{name} is {host}" for name, host in hosts.items() if not host.startswith("127.")]
    rtu = site.gripper.modbus_rtu
    if site.gripper.driver == "modbus_rtu" and rtu.line == "serial":
        real.append(f"gripper.modbus_rtu.serial_port is {rtu.serial_port}")
    if site.can.enabled and site.can.real_bus:
        real.append(f"can.channel is {site.can.channel}")
    if site.camera.driver != "twin":
        real.append(f"camera.driver is {site.camera.driver}")
    if real:
        raise BadInputError(
            f"the demonstration works with the twin only, but {', '.join(real)}: unset STATION_CONFIG and the "
            "variables STATION_… of the devices"
        )


def _logs(site: Configuration) -> Path:
    logs = site.home / "logs"
    try:
        logs.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInputError(f"{logs}: cannot be made: {error.strerror}; name another STATION_HOME") from error
    return logs


async def _run(
    site: Configuration, supervisor: Supervisor, nest: TwinNest, program: LineProgram, pace: Pace, count: int | None
) -> None:
    ended, ready = asyncio.Event(), asyncio.Event()
    on_end_signals(ended.set)
    click.echo(f"starting the twin, the station, the PLC interface and the pages; their logs: {site.home / 'logs'}")
    supervising = asyncio.create_task(supervisor.run(ready.set, ended))
    waiting = asyncio.create_task(ready.wait())
    try:
        await asyncio.wait([supervising, waiting], return_when=asyncio.FIRST_COMPLETED)
        if ready.is_set() and not ended.is_set():
            click.echo(addresses(site))
            await _inspect(site, nest, program, pace, count, ended)
    finally:
        waiting.cancel()
        ended.set()
        await supervising


async def _inspect(
    site: Configuration, nest: TwinNest, program: LineProgram, pace: Pace, count: int | None, ended: asyncio.Event
) -> None:
    modbus = site.modbus
    async with Scanner(modbus.host, modbus.port, modbus.unit, WordOrder(modbus.word_order)) as scanner:
        simulator = LineSimulator(program, scanner, nest, pace)
        with LineDisplay(Console(), simulator.summary, lambda sequence: _sketch(site, sequence)) as display:
            simulator.on_passage, simulator.on_scan = display.passed, display.show_activity
            running = asyncio.create_task(simulator.run(count))
            waiting = asyncio.create_task(ended.wait())
            try:
                await asyncio.wait([running, waiting], return_when=asyncio.FIRST_COMPLETED)
                if not ended.is_set():
                    await running
            finally:
                waiting.cancel()
                running.cancel()
                await asyncio.gather(running, return_exceptions=True)
        click.echo(summary_line(simulator.summary))
        click.echo(_next_steps(site.home))


def _next_steps(home: Path) -> str:
    """Return the commands that follow a demonstration."""
    return (
        "next, the records of these fruit (the number is in the column `record`):\n"
        f"  export STATION_HOME={home}\n"
        "  ./run station records list\n"
        "  ./run station records show NUMBER        why this fruit passed or was diverted\n"
        "  ./run station records report DEMO lot.html\n"
        "and docs/index.md: one guide each for operator, quality, PLC, maintenance and research"
    )


def _sketch(site: Configuration, sequence: int) -> str:
    """Draw a result's area over closing, from the station's records."""
    folder = records_folder(site.home)
    try:
        with reading(folder) as connection:
            judged = read_inspection(connection, sequence, folder).judged
            return sparkline([point.area_mm2 for point in judged.curve]) if judged else ""
    except StationError:
        return ""
