"""`station line`: the PLC simulator, against a station in the demonstration or on the floor."""

import asyncio
import signal
from pathlib import Path

import click
from rich.console import Console

from plc_interface.plc_simulator.display import LineDisplay, summary_line
from plc_interface.plc_simulator.faults import FaultPlan, LineFault
from plc_interface.plc_simulator.nest import SEVERITIES, Nest, RealNest, TwinNest
from plc_interface.plc_simulator.program import LineProgram
from plc_interface.plc_simulator.scan import Scanner
from plc_interface.plc_simulator.simulator import LineSimulator, Pace
from plc_interface.registers.codec import WordOrder
from station.config_option import config_option
from station.errors import BadInputError, StationError
from station.settings.configuration import load_configuration
from station.settings.recipe import load_recipes
from station.vocabulary import LONGEST_LOT

_ENDING_S = 0.5


@click.command("line")
@config_option
@click.option("--count", type=click.IntRange(min=1), help="End after so many fruits; else Ctrl-C ends it.")
@click.option(
    "--every",
    "every_s",
    type=click.FloatRange(0, 3600),
    default=0.0,
    show_default=True,
    metavar="S",
    help="Seconds from fruit to fruit at least.",
)
@click.option(
    "--scan",
    "scan_ms",
    type=click.IntRange(1, 1000),
    default=10,
    show_default=True,
    metavar="MS",
    help="Milliseconds from scan to scan.",
)
@click.option("--lot", default="", help=f"Lot to latch, at most {LONGEST_LOT} ASCII characters.")
@click.option("--separate", is_flag=True, help="Write and read by function codes 16 and 3 in place of 23.")
@click.option(
    "--twin",
    "console_port",
    type=click.IntRange(1, 65_535),
    metavar="PORT",
    help="Lay fruit into the nest of the twin with this console; else somebody lays them.",
)
@click.option("--fruit", "kinds", multiple=True, metavar="NAME", help="Recipes to draw fruit for; may be repeated.")
@click.option(
    "--damaged",
    "damaged_share",
    type=click.FloatRange(0, 1),
    default=0.2,
    show_default=True,
    help="Share of damaged fruit in the twin.",
)
@click.option(
    "--severity",
    type=click.Choice(SEVERITIES),
    default=SEVERITIES[0],
    show_default=True,
    help="How the twin's damaged fruit are damaged.",
)
@click.option(
    "--grader/--no-grader",
    "graded",
    default=True,
    show_default=True,
    help="Whether the twin's fruit come with a length.",
)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=1, show_default=True, help="Which fruits.")
@click.option(
    "--fault",
    "faults",
    multiple=True,
    type=click.Choice([fault.value for fault in LineFault]),
    help="What the PLC does wrong; may be repeated.",
)
@click.option("--fault-every", type=click.IntRange(min=1), default=3, show_default=True, help="One fruit in so many.")
def line(
    config: Path | None,
    count: int | None,
    every_s: float,
    scan_ms: int,
    lot: str,
    separate: bool,  # noqa: FBT001 (click passes arguments by name)
    console_port: int | None,
    kinds: tuple[str, ...],
    damaged_share: float,
    severity: str,
    graded: bool,  # noqa: FBT001 (click passes arguments by name)
    seed: int,
    faults: tuple[str, ...],
    fault_every: int,
) -> None:  # fmt: skip
    """Simulate the line's PLC: trigger, read and acknowledge inspections, and show the decision on each fruit.

    Takes the right to write, so no other PLC may hold it. Exits 0 when all fruits were decided, or when there was no
    number of them; 1 when it was ended before.
    """
    site = load_configuration(config)
    if not (lot.isascii() and len(lot) <= LONGEST_LOT and (lot.isprintable() or not lot)):
        raise BadInputError(f"--lot: expected at most {LONGEST_LOT} printable ASCII characters, got {lot!r}")
    nest: Nest = RealNest()
    if console_port is not None:
        numbers = _numbers(kinds, site.recipes_folder)
        nest = TwinNest(console_port, numbers, damaged_share, seed, graded=graded, severity=severity)
    elif kinds:
        raise BadInputError("--fruit: only the twin can lay fruit of a kind; give its console with --twin")
    program = LineProgram(FaultPlan([LineFault(fault) for fault in faults], fault_every), lot)
    scanner = Scanner(
        site.modbus.host,
        site.modbus.port,
        site.modbus.unit,
        WordOrder(site.modbus.word_order),
        one_round_trip=not separate,
    )
    asyncio.run(_run(program, scanner, nest, Pace(scan_ms / 1000, every_s), count))


def _numbers(kinds: tuple[str, ...], folder: Path | None) -> dict[str, int]:
    recipes = load_recipes(folder)
    wanted = kinds or ("strawberry", "raspberry", "blueberry")
    unknown = [kind for kind in wanted if kind not in recipes]
    if unknown:
        raise BadInputError(f"--fruit: there is no recipe {', '.join(unknown)}; there are: {', '.join(recipes)}")
    return {kind: recipes[kind].plc_number for kind in wanted}


async def _run(program: LineProgram, scanner: Scanner, nest: Nest, pace: Pace, count: int | None) -> None:
    console = Console()
    async with scanner:
        simulator = LineSimulator(program, scanner, nest, pace)
        running, interrupted = asyncio.ensure_future(simulator.run(count)), asyncio.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            asyncio.get_running_loop().add_signal_handler(number, interrupted.set)
        ending = asyncio.ensure_future(interrupted.wait())
        with LineDisplay(console, simulator.summary) as display:
            simulator.on_passage, simulator.on_scan = display.passed, display.show_activity
            await asyncio.wait([running, ending], return_when=asyncio.FIRST_COMPLETED)
            ending.cancel()
            while not running.done():  # Python 3.11's wait_for loses a cancellation that comes with its answer
                running.cancel()
                await asyncio.wait([running], timeout=_ENDING_S)
        await simulator.release()
        console.print(summary_line(simulator.summary))
        if not running.cancelled():
            running.result()
        elif count is not None and simulator.summary.fruits < count:
            decided = simulator.summary.fruits
            raise StationError(f"the line was ended after {decided} of {count} fruits; start it anew for the others")
