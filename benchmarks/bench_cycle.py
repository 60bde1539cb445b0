"""What one fruit's cycle is made of: motion, settling, camera, ours; beside the same moves bare.

Run with `./run bench cycle`. Starts a twin with an arm and the station's process, has fruit inspected over the
channel, then makes the same moves and waits without the station: the same drivers, the measured widths, as many
frames, nothing else. Writes `docs/cycle-time.md`.
"""

import asyncio
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable
from pathlib import Path
from typing import NamedTuple

from station.channel.client import ChannelClient
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    Begun,
    Command,
    CommandDone,
    CommandName,
    Line,
    Noted,
    Outcome,
    Published,
    StationState,
)
from station.commands.simulated_unit import calibrate_simulated_unit
from station.devices.arm.ur import UrArm
from station.devices.camera.open import camera_from
from station.devices.gripper.robotiq import make_gripper
from station.records.model import FullRecord
from station.records.records import Records
from station.service.grip import FINEST_STEP_MM, Cell, Grip
from station.settings.configuration import Configuration, load_configuration
from station.settings.plc import line_endpoint
from station.settings.recipe import Recipe, load_recipes
from station.twin.console import ask
from station.twin.fruit import Kind, draw_fruit

ROOT = Path(__file__).resolve().parents[1]
HOST = "127.0.0.11"
CONSOLE = 49311
FRUIT = (("strawberry", 4), ("raspberry", 4), ("blueberry", 1))
REPEATS = 4
PATIENCE_S = 120.0
PHASES = {
    "reference": "reference",
    "approaching": "approach",
    "closing_to_onset": "onset",
    "opening_again": "onset",
    "centring": "onset",
    "measuring_last": "last measurement",
    "awaiting_measure_last": "last measurement",
    "judging": "judging and recording",
    "recording_accept": "judging and recording",
    "recording_reject": "judging and recording",
}
"""What the cycle's states belong to here; all others are steps."""
LINE = Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=())


class Inspected(NamedTuple):
    """One fruit as the station inspected it."""

    to_outcome_s: float
    to_ready_s: float
    sequence: int
    outcome: str


def start(name: str, file: Path, *arguments: str) -> subprocess.Popen[str]:
    """One of the station's programs; returns once it runs, and ends with its messages where it does not."""
    command = [sys.executable, "-m", "station", name, *arguments, "--config", str(file)]
    messages = file.with_name(f"{name}.log")
    with messages.open("w") as output:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=output, text=True)
    if not any(line.startswith("running") for line in process.stdout or ()):
        process.communicate()
        raise SystemExit(f"station {name} ended with exit code {process.returncode}:\n{messages.read_text()}")
    return process


async def inspect(configuration: Configuration) -> dict[str, list[Inspected]]:
    """Every fruit some times over the channel."""
    recipes, results = load_recipes(), {}
    endpoint = line_endpoint(configuration.handshake, configuration.home)
    async with ChannelClient(endpoint, "the station") as client:

        async def ready() -> None:
            deadline_s = time.monotonic() + PATIENCE_S
            while not (state := await client.ask(LINE, StationState, deadline_s=20)).ready:
                if time.monotonic() > deadline_s:
                    raise SystemExit(f"the station does not become ready: {state.why_not_ready}")
                await asyncio.sleep(0.005)

        for kind, seed in FRUIT:
            order = Command(command=CommandName.CHANGE_RECIPE, argument=recipes[kind].plc_number)
            await client.ask(order, CommandDone, deadline_s=40)
            for repeat in range(REPEATS):
                ask("127.0.0.1", CONSOLE, {"do": "fruit", "kind": kind, "seed": seed})
                await ready()
                began_s = time.monotonic()
                length = round(10 * draw_fruit(Kind(kind), seed).length_mm)
                trigger = Begin(trigger_id=repeat + 1, encoder=0, lot="", fruit_length_mm_x10=length)
                begun = await client.ask(trigger, Begun, deadline_s=5)
                if begun.sequence is None:
                    raise SystemExit(f"the station refuses: {begun.refusal}")
                outcome = await client.ask(AwaitOutcome(sequence=begun.sequence), Outcome, deadline_s=PATIENCE_S)
                told_s = time.monotonic() - began_s
                await ready()
                again_s = time.monotonic() - began_s
                await client.ask(Published(outcome=outcome), Noted, deadline_s=5)
                await client.ask(Acknowledged(sequence=outcome.sequence), Noted, deadline_s=5)
                results.setdefault(kind, []).append(Inspected(told_s, again_s, outcome.sequence, outcome.outcome))
    return results


def widths_mm(recipe: Recipe, record: FullRecord, widest_mm: float) -> tuple[list[float], list[float]]:
    """The widths that the station asked for: at a glance on the way to the onset, and in full steps."""
    judged = record.judged
    if judged is None or not judged.curve:
        raise SystemExit(f"inspection {record.sequence} was not measured: {judged and judged.explanation}")
    onset_mm, step_mm = judged.curve[0].width_mm, recipe.steps.step_mm
    glances = [min(recipe.expected_width.largest_mm, widest_mm)]
    while glances[-1] > onset_mm:
        glances.append(glances[-1] - step_mm)
    fine = [glances[-1] + step_mm]
    while fine[-1] > onset_mm + FINEST_STEP_MM / 2:
        fine.append(fine[-1] - FINEST_STEP_MM)
    steps = [onset_mm - number * step_mm for number in range(len(judged.curve))]
    return [*glances, *fine], steps


class Stopwatch:
    """Adds up what is waited for, by kind and by the phase of the cycle."""

    def __init__(self) -> None:
        self.kinds_s: dict[str, float] = {"motion": 0.0, "settling": 0.0, "camera": 0.0}
        self.phases_s: dict[str, float] = {}

    async def time(self, phase: str, kind: str, work: Awaitable[object]) -> None:
        """Wait for something."""
        began_s = time.monotonic()
        await work
        spent_s = time.monotonic() - began_s
        self.kinds_s[kind] += spent_s
        self.phases_s[phase] = self.phases_s.get(phase, 0.0) + spent_s


Spent = dict[str, list[tuple[dict[str, float], Stopwatch]]]
"""For each inspection of a fruit the station's phases, and the floor."""


async def bare(cell: Cell, recipe: Recipe, record: FullRecord) -> Stopwatch:
    """The same moves, waits and frames as in an inspection, and nothing else."""
    grip, watch, imaging = Grip(cell, recipe), Stopwatch(), recipe.imaging
    glances, steps = widths_mm(recipe, record, cell.gripper.max_width_mm)
    await watch.time("reference", "motion", cell.gripper.open())
    await watch.time("reference", "camera", grip.sound_frames(imaging.reference_frames))
    await watch.time("approach", "motion", grip.go("above_nest", "nest"))
    for width_mm in glances:
        await watch.time("onset", "motion", grip.close_to(width_mm))
        await watch.time("onset", "camera", grip.sound_frames(1))
    for phase, width_mm in zip(["onset", *("steps" for _ in steps)], steps, strict=False):
        await watch.time(phase, "motion", grip.close_to(width_mm))
        await watch.time(phase, "settling", asyncio.sleep(imaging.settle_s))
        await watch.time(phase, "camera", grip.sound_frames(imaging.frames_per_step))
    await watch.time("release and return", "motion", cell.gripper.open())
    await watch.time("release and return", "motion", grip.go("above_nest", "home"))
    return watch


def phases_s(record: FullRecord) -> dict[str, float]:
    """The station's own time by phase, up to the record; it names them as its states."""
    spent_s: dict[str, float] = {}
    for state, seconds in (record.judged.phases_s if record.judged else {}).items():
        spent_s[PHASES.get(state, "steps")] = spent_s.get(PHASES.get(state, "steps"), 0.0) + seconds
    return spent_s


async def floors(configuration: Configuration, results: dict[str, list[Inspected]]) -> Spent:
    """The station's phases and the bare moves of every inspection."""
    recipes, spent = load_recipes(), {}
    records = Records(configuration.home / "records", configuration.records, "bench")
    await records.reopen()
    camera, gripper = camera_from(configuration.camera), make_gripper(configuration.gripper)
    await camera.open()
    async with UrArm(configuration.arm) as arm:
        await arm.ready(PATIENCE_S)
        arm.renew_health(600.0)
        await gripper.activate()
        await arm.move_to("home")
        for kind, seed in FRUIT:
            for inspected in results[kind]:
                ask("127.0.0.1", CONSOLE, {"do": "fruit", "kind": kind, "seed": seed})
                record = await records.inspection(inspected.sequence)
                floor = await bare(Cell(camera, gripper, arm), recipes[kind], record)
                spent.setdefault(kind, []).append((phases_s(record), floor))
    await gripper.close()
    await camera.close()
    await records.close()
    return spent


def table(results: dict[str, list[Inspected]], spent: Spent) -> list[str]:
    """Medians over the repeats."""
    rows = []
    for kind, _ in FRUIT:
        outcomes = ", ".join(sorted({each.outcome for each in results[kind]}))
        outcome_s = statistics.median(each.to_outcome_s for each in results[kind])
        cycle_s = statistics.median(each.to_ready_s for each in results[kind])
        floors_s = [floor.kinds_s for _, floor in spent[kind]]
        parts = {name: statistics.median(each[name] for each in floors_s) for name in floors_s[0]}
        floor_s = sum(parts.values())
        ours_s = cycle_s - floor_s
        rows.append(
            f"| {kind} | {outcomes} | {outcome_s:.2f} | {cycle_s:.2f} | {parts['motion']:.2f} | "
            f"{parts['settling']:.2f} | {parts['camera']:.2f} | {floor_s:.2f} | {ours_s:.2f} | "
            f"{100 * ours_s / cycle_s:.1f} % |"
        )
    return rows


def phase_table(results: dict[str, list[Inspected]], spent: Spent) -> list[str]:
    """Where ours goes: each phase of the station's beside the floor's, medians, ms."""
    names = ("reference", "approach", "onset", "steps", "last measurement", "judging and recording")
    rows = []
    for kind, _ in FRUIT:
        cells, rest_ms = (
            [],
            1000
            * statistics.median(
                all_.to_ready_s - sum(station.values()) - floor.phases_s["release and return"]
                for all_, (station, floor) in zip(results[kind], spent[kind], strict=True)
            ),
        )
        for name in names:
            ours_s = statistics.median(
                station.get(name, 0.0) - floor.phases_s.get(name, 0.0) for station, floor in spent[kind]
            )
            cells.append(f"{1000 * ours_s:.0f}")
        rows.append(f"| {kind} | {' | '.join(cells)} | {rest_ms:.0f} |")
    return [f"| fruit | {' | '.join(names)} | trigger, release, return |", "|---" * 8 + "|", *rows]


def main() -> None:
    """Measure, print and write the table."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "station.yaml"
        file.write_text(
            f"home: {folder}\narm: {{host: {HOST}}}\n"
            f"gripper: {{urcap: {{host: {HOST}}}, modbus_rtu: {{host: {HOST}}}}}\n"
            "camera: {twin: {port: 49310}}\nmetrics: {port: 49312}\nrecords: {free_reserve_mb: 1}\n"
            "service: {patience: 10.0}\n"
        )
        configuration = load_configuration(file, {})
        calibrate_simulated_unit(configuration, "bench")
        twin = start("twin", file, "--console", str(CONSOLE))
        try:
            service = start("service", file)
            try:
                results = asyncio.run(inspect(configuration))
            finally:
                service.terminate()
                service.communicate()
            spent = asyncio.run(floors(configuration, results))
        finally:
            twin.terminate()
            twin.communicate()
    load = os.getloadavg()[0]
    lines = [
        "# How long a fruit takes, and what of it is ours",
        "",
        f"Written by `./run bench cycle`: medians of {REPEATS} inspections of each fruit on the twin with its arm,",
        f"with a load of {load:.1f} on {os.cpu_count()} cores. The cycle is from trigger to ready again. Beside it,",
        "in the same run, the floor: the same drivers make the same moves to the same widths, settle as long and take",
        "as many frames, with no reference examined, nothing measured, judged, recorded or told. Ours is the cycle",
        "less the floor; what others make of a busy machine's processors counts as ours.",
        "",
        "| fruit | outcome | to outcome, s | cycle, s | motion, s | settling, s | camera, s | floor, s | ours, s | % |",
        "|---|---|---|---|---|---|---|---|---|---|",
        *table(results, spent),
        "",
        "## Where ours goes",
        "",
        "Each phase of the station's less the floor's, ms, medians. On the onset's last millimetres nothing else can",
        "go on while a picture is measured, and a stride that was begun meanwhile on the way there is stopped. The",
        "steps' measurements overlap their moves; their last one, after which an early stop ends the next step's move,",
        "does not.",
        "",
        *phase_table(results, spent),
        "",
    ]
    print("\n".join(lines))
    (ROOT / "docs" / "cycle-time.md").write_text("\n".join(lines))


if __name__ == "__main__":
    main()
