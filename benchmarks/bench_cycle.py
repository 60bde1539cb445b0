"""One fruit's cycle: its times, fruit a minute, and what of it is motion, settling, camera and ours.

Run with `./run bench cycle`. Starts a twin with an arm and the station's process, has fruit inspected over the channel,
one by one and then as fast as triggers are accepted, and makes the same moves and waits without the station: the same
drivers, the measured widths, as many frames, nothing else. Writes `docs/cycle-time.md`, `docs/images/cycle-time.svg`,
and the pace into `README.md` and `docs/plc/index.md`.
"""

import asyncio
import contextlib
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Iterator, Mapping
from itertools import count
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.figure import Figure
from sections import write

from station.channel.client import ChannelClient
from station.channel.line import (
    Acknowledged,
    AwaitOutcome,
    Begin,
    BeginReply,
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
from station.inspection.press import FINEST_STEP_MM
from station.press.stop import MOST_UNSEEN_MM
from station.records.database import reading
from station.records.model import FullRecord
from station.records.queries import read_inspection
from station.records.records import Records
from station.runtime.devices.rig import Cell, DeviceRig, at_once
from station.settings.configuration import Configuration, load_configuration
from station.settings.plc import line_endpoint
from station.settings.recipe import load_recipes
from station.settings.recipe_model import Recipe
from station.twin.console import ask
from station.twin.fruit import Kind, draw_fruit
from station.vocabulary import PackmlState

ROOT = Path(__file__).resolve().parents[1]
CHART = ROOT / "docs" / "images" / "cycle-time.svg"
HOST = "127.0.0.11"
CONSOLE = 49311
FRUIT = ("strawberry", "raspberry", "blueberry")
SEEDS = range(1, 16)
"""Of each kind's fruit. Several, since the steps that one needs depend on it; odd, so that one is the median."""
IN_A_ROW = 8
PAGES_WITH_PACE = ("README.md", "docs/plc/index.md")
PATIENCE_S = 120.0
PHASES = {
    "retreating_accepted": "approach",
    "reference": "approach",
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
PARTS = {
    ("approach", "motion"): ("arm down, reference meanwhile", "#4477aa"),
    ("onset", "motion"): ("closing to the onset", "#66ccee"),
    ("onset", "camera"): ("its frames", "#aaddee"),
    ("steps", "motion"): ("steps", "#228833"),
    ("steps", "settling"): ("settling", "#ccbb44"),
    ("steps", "camera"): ("frames of steps", "#ee6677"),
    ("release", "motion"): ("release", "#aa3377"),
}
"""The chart's parts: phase and kind, their name and colour."""
DOCUMENT = """\
# Cycle time: fruit a minute, and what limits it

Written by `./run bench cycle`: medians of {fruit} sound fruit of each kind on the twin with its arm, which waits
above the nest, with a load of {load:.1f} on {cores} cores. *Next trigger* is where the station accepts one again:
fruit and jaws are free, and the arm leaves meanwhile. *Fruit a minute* is measured in a row of {in_a_row} of the fruit
with the median time, each triggered as soon as it is accepted; the arm's way back is in it. The fruit lie in the
middle; *closed on twice* are those whose contact was not there, or whose press was inconclusive. With fruit that lie
anywhere: [a mixed line](triggers.md). Unverified on hardware.

{table}

*Steps measured*: by the shipped recipe's `steps.measured`. *Otherwise*: the other way, in the same run. The force
on the fruit by both ways:
[decision 63](decisions/0063-measurement-while-the-jaws-close.md#force-on-the-fruit).

![The floor's parts and ours](images/cycle-time.svg)

The **floor**: the same drivers make the same moves to the same widths, settle as long and take as many frames, with
no reference examined, nothing measured, judged, recorded or published. Ours is the cycle less the floor; what others
make of a busy machine's processors counts as ours.

**What limits it**: closing at 20 mm/s, the slowest that the 2F-85 goes, from just wider than the widest fruit that
the recipe expects; the motion, a frame's pause and three frames at 30 frames/s of each step, where it is measured at
rest; and the arm's way down.

## Overshoot

The fingers close until a frame that shows the contact is measured, and then stop: they run on for as long as that
frame is old and the gripper takes to react. From the first frame with a contact on, mm:

{overshoots}

It is bounded by {most_mm:g} mm and one reaction, since the fingers wait for a measurement that is late. The onset is
then found count by count from where nothing touched, so its uncertainty is one count, as in
[the budget](quality.md).

## Where ours goes

Each phase of the station's less the floor's, ms, medians.

{phases}
"""
LINE = Line(plc_connected=True, plc_alive=True, enabled=True, waiting=0, counters={}, faults=())


class Inspected(NamedTuple):
    """One fruit as the station inspected it."""

    seed: int
    """The fruit's."""
    to_outcome_s: float
    to_next_s: float
    """To where the next trigger is accepted."""
    sequence: int
    outcome: str
    overshoot_mm: float = 0.0
    """By the record."""


class Pace(NamedTuple):
    """All inspections of one kind of fruit."""

    alone: list[Inspected]
    """Each triggered with the arm at rest where it waits."""
    a_minute: float
    """Fruit a minute where each is triggered as soon as the station accepts it."""


def start(name: str, file: Path, *arguments: str) -> subprocess.Popen[str]:
    """One of the station's programs; returns once it runs, and ends with its messages where it does not."""
    command = [sys.executable, "-m", "station", name, *arguments, "--config", str(file)]
    messages = file.with_name(f"{name}.log")
    with messages.open("w") as output:
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=output, text=True, cwd=ROOT, env=environment)
    if not any(line.startswith("running") for line in process.stdout or ()):
        process.communicate()
        raise SystemExit(f"station {name} ended with exit code {process.returncode}:\n{messages.read_text()}")
    return process


@contextlib.contextmanager
def ended(process: subprocess.Popen[str]) -> Iterator[None]:
    """End a program after its use."""
    try:
        yield
    finally:
        process.terminate()
        process.communicate()


async def inspect(configuration: Configuration) -> dict[str, Pace]:
    """Every fruit some times over the channel, from rest and in a row."""
    recipes, results = load_recipes(), {}
    endpoint = line_endpoint(configuration.handshake, configuration.home)
    async with ChannelClient(endpoint, "the station") as client:

        async def ready(*, at_rest: bool = False) -> None:
            deadline_s = time.monotonic() + PATIENCE_S
            while True:
                state = await client.request(LINE, StationState, deadline_s=20)
                if state.ready and (not at_rest or state.packml_state is PackmlState.IDLE):
                    return
                if time.monotonic() > deadline_s:
                    raise SystemExit(f"the station does not become ready: {state.why_not_ready}")
                await asyncio.sleep(0.001)

        async def one(kind: str, seed: int, number: int, *, at_rest: bool) -> Inspected:
            await ready(at_rest=at_rest)
            began_s = time.monotonic()
            length = round(10 * draw_fruit(Kind(kind), seed).length_mm)
            trigger = Begin(trigger_id=number, encoder=0, lot="", fruit_length_mm_x10=length)
            reply = await client.request(trigger, BeginReply, deadline_s=5)
            if reply.sequence is None:
                raise SystemExit(f"the station refuses: {reply.refusal}")
            outcome = await client.request(AwaitOutcome(sequence=reply.sequence), Outcome, deadline_s=PATIENCE_S)
            outcome_s = time.monotonic() - began_s
            await ready()
            again_s = time.monotonic() - began_s
            await client.request(Published(outcome=outcome), Noted, deadline_s=5)
            await client.request(Acknowledged(sequence=outcome.sequence), Noted, deadline_s=5)
            return Inspected(seed, outcome_s, again_s, outcome.sequence, outcome.outcome)

        for kind in FRUIT:
            order = Command(command=CommandName.CHANGE_RECIPE, argument=recipes[kind].plc_number)
            await client.request(order, CommandDone, deadline_s=40)
            numbers, alone = count(1), list[Inspected]()
            for seed in SEEDS:
                await ready(at_rest=True)
                lay(kind, seed)
                alone.append(await one(kind, seed, next(numbers), at_rest=True))
            await ready(at_rest=True)
            seed = statistics.median_low(sorted((each.to_next_s, each.seed) for each in alone))[1]
            lay(kind, seed)
            began_s = time.monotonic()
            for _ in range(IN_A_ROW):
                await one(kind, seed, next(numbers), at_rest=False)
            results[kind] = Pace(alone, 60 * IN_A_ROW / (time.monotonic() - began_s))
    return results


def lay(kind: str, seed: int) -> None:
    """Lay a sound fruit into the twin's nest."""
    ask("127.0.0.1", CONSOLE, {"do": "fruit", "kind": kind, "seed": seed})


class Stopwatch:
    """Adds up what is waited for, by kind and by the phase of the cycle."""

    def __init__(self) -> None:
        self.kinds_s: dict[str, float] = {"motion": 0.0, "settling": 0.0, "camera": 0.0}
        self.phases_s: dict[str, float] = {}
        self.parts_s: dict[tuple[str, str], float] = {}

    async def time(self, phase: str, kind: str, work: Awaitable[object]) -> None:
        """Wait for something."""
        began_s = time.monotonic()
        await work
        spent_s = time.monotonic() - began_s
        self.kinds_s[kind] += spent_s
        self.parts_s[phase, kind] = self.parts_s.get((phase, kind), 0.0) + spent_s
        self.phases_s[phase] = self.phases_s.get(phase, 0.0) + spent_s


Spent = dict[str, list[tuple[Inspected, dict[str, float], Stopwatch]]]
"""For each inspection of a fruit from rest, the station's phases and the floor."""


async def bare(configuration: Configuration, cell: Cell, recipe: Recipe, record: FullRecord) -> Stopwatch:
    """The same moves, waits and frames as in an inspection measured at rest, and nothing else."""
    grip, watch, imaging = DeviceRig(cell, recipe), Stopwatch(), recipe.imaging
    judged = record.judged
    if judged is None or not judged.curve:
        raise SystemExit(f"inspection {record.sequence} was not measured: {judged and judged.explanation}")
    onset_mm = judged.curve[0].width_mm
    around_mm = min(recipe.expected_width.largest_mm + configuration.arm.jaw_clearance_mm, cell.gripper.max_width_mm)

    async def frames() -> None:
        await grip.frames(imaging.reference_frames)

    async def arrive() -> None:
        await at_once(grip.go("above_nest", "nest"), cell.gripper.open(around_mm), frames())

    await watch.time("approach", "motion", arrive())
    overshoot_mm = float(judged.measures.get("overshoot_mm") or 0.0)
    await watch.time("onset", "motion", grip.close_to(onset_mm - overshoot_mm))
    await watch.time("onset", "camera", grip.frames(1))
    await watch.time("onset", "motion", cell.gripper.open(onset_mm + 2 * FINEST_STEP_MM))
    await watch.time("onset", "camera", grip.frames(1))
    await watch.time("onset", "motion", grip.close_to(onset_mm + FINEST_STEP_MM))
    await watch.time("onset", "camera", grip.frames(1))
    await watch.time("onset", "motion", grip.close_to(onset_mm))
    await watch.time("onset", "camera", grip.frames(imaging.frames_per_step))
    for number in range(1, len(judged.curve)):
        await watch.time("steps", "motion", grip.close_to(onset_mm - number * recipe.steps.step_mm))
        await watch.time("steps", "settling", asyncio.sleep(imaging.settle_s))
        await watch.time("steps", "camera", grip.frames(imaging.frames_per_step))
    await watch.time("release", "motion", cell.gripper.open(around_mm))
    await at_once(grip.go("above_nest"), cell.gripper.open())
    return watch


def phases_s(record: FullRecord) -> dict[str, float]:
    """The station's own time by phase, up to the record; it names them as its states."""
    spent_s: dict[str, float] = {}
    for state, seconds in (record.judged.phases_s if record.judged else {}).items():
        spent_s[PHASES.get(state, "steps")] = spent_s.get(PHASES.get(state, "steps"), 0.0) + seconds
    return spent_s


async def floors(configuration: Configuration, results: Mapping[str, Pace]) -> Spent:
    """The station's phases and the bare moves of every inspection from rest that pressed once."""
    recipes, spent = load_recipes(), {}
    records = Records(configuration.home / "records", configuration.records, "bench")
    await records.reopen()
    camera, gripper = camera_from(configuration.camera), make_gripper(configuration.gripper)
    await camera.open()
    async with UrArm(configuration.arm) as arm:
        await arm.ready(PATIENCE_S)
        arm.renew_health(600.0)
        await gripper.activate()
        await arm.move_to("above_nest")
        for kind in FRUIT:
            for inspected in results[kind].alone:
                with reading(records.folder) as connection:
                    record = read_inspection(connection, inspected.sequence, records.folder)
                if record.judged is None or record.judged.measures.get("closings") != 1:
                    continue
                lay(kind, inspected.seed)
                overshoot_mm = float(record.judged.measures.get("overshoot_mm") or 0.0)
                floor = await bare(configuration, Cell(camera, gripper, arm), recipes[kind], record)
                spent.setdefault(kind, []).append(
                    (inspected._replace(overshoot_mm=overshoot_mm), phases_s(record), floor)
                )
    await gripper.close()
    await camera.close()
    await records.close()
    return spent


def medians(pace: Pace) -> tuple[float, float]:
    """Seconds to the outcome and to the next trigger."""
    return (
        statistics.median(each.to_outcome_s for each in pace.alone),
        statistics.median(each.to_next_s for each in pace.alone),
    )


WAYS = {"at_rest": "at rest", "while_closing": "while closing"}
"""`steps.measured` in words."""


def table(
    shipped: Mapping[str, Recipe],
    results: Mapping[str, Pace],
    other: Mapping[str, Pace],
    spent: Spent,
) -> list[str]:
    """Medians over the fruit."""
    rows = []
    for kind in FRUIT:
        pace = results[kind]
        outcomes = ", ".join(f"{times} {name}" for name, times in Counter(each.outcome for each in pace.alone).items())
        twice = len(pace.alone) - len(spent[kind])
        outcome_s, next_s = medians(pace)
        floor_s = statistics.median(sum(floor.kinds_s.values()) for _, _, floor in spent[kind])
        ours_s = statistics.median(each.to_next_s - sum(floor.kinds_s.values()) for each, _, floor in spent[kind])
        cells = [kind, WAYS[shipped[kind].steps.measured], outcomes, f"{twice}"]
        cells += [f"{outcome_s:.2f}", f"{next_s:.2f}", f"{pace.a_minute:.1f}"]
        cells += [*(f"{seconds:.2f}" for seconds in medians(other[kind])), f"{other[kind].a_minute:.1f}"]
        rows.append(f"| {' | '.join(cells)} | {floor_s:.2f} | {ours_s:.2f} | {100 * ours_s / floor_s:.1f} % |")
    names = ("fruit", "steps measured", "outcome", "closed on twice", "to outcome, s", "to next trigger, s")
    others = ("fruit a minute", "otherwise: to outcome", "to next trigger", "fruit a minute", "floor, s", "ours, s")
    heads = (*names, *others, "% of the floor")
    return [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|", *rows]


def pace_table(shipped: Mapping[str, Recipe], results: Mapping[str, Pace], other: Mapping[str, Pace]) -> list[str]:
    """Return the table that a line builder needs first: fruit a minute, times to the outcome and next trigger."""
    rows = []
    for kind in FRUIT:
        outcome_s, next_s = medians(results[kind])
        way, otherwise = shipped[kind].steps.measured, other_way(shipped[kind])
        cells = (
            kind,
            WAYS[way],
            f"{results[kind].a_minute:.0f}",
            f"{outcome_s:.1f}",
            f"{next_s:.1f}",
            f"{other[kind].a_minute:.0f} {WAYS[otherwise]}",
        )
        rows.append(f"| {' | '.join(cells)} |")
    names = (
        "fruit",
        "steps measured",
        "fruit a minute",
        "trigger to outcome, s",
        "to the next trigger, s",
        "fruit a minute the other way",
    )
    return [f"| {' | '.join(names)} |", "|---" * 6 + "|", *rows]


def phase_table(spent: Spent) -> list[str]:
    """Return a table of the station's own time by phase: its phases less those of the floor, medians, ms."""
    names = ("approach", "onset", "steps", "last measurement", "judging and recording")
    rows = []
    for kind in FRUIT:
        cells = []
        for name in names:
            ours_s = statistics.median(
                station.get(name, 0.0) - floor.phases_s.get(name, 0.0) for _, station, floor in spent[kind]
            )
            cells.append(f"{1000 * ours_s:.0f}")
        rest_s = statistics.median(
            each.to_next_s - sum(station.values()) - floor.phases_s["release"] for each, station, floor in spent[kind]
        )
        rows.append(f"| {kind} | {' | '.join(cells)} | {1000 * rest_s:.0f} |")
    return [f"| fruit | {' | '.join(names)} | trigger and release |", "|---" * 7 + "|", *rows]


def overshoot_table(spent: Spent) -> list[str]:
    """Return a table of how far the fingers ran on after the first frame with a contact, mm."""
    rows = []
    for kind in FRUIT:
        ways_mm = sorted(each.overshoot_mm for each, *_ in spent[kind])
        rows.append(f"| {kind} | {statistics.median(ways_mm):.1f} | {ways_mm[-1]:.1f} |")
    return ["| fruit | median | most |", "|---|---|---|", *rows]


def draw(spent: Spent) -> None:
    """The floor's parts and ours, one bar for each fruit."""
    figure = Figure(figsize=(9, 3.0), layout="constrained")
    axes = figure.subplots()
    kinds = list(FRUIT)
    left = dict.fromkeys(kinds, 0.0)
    for (phase, what), (label, colour) in PARTS.items():
        widths = {
            kind: statistics.median(floor.parts_s.get((phase, what), 0.0) for *_, floor in spent[kind])
            for kind in kinds
        }
        axes.barh(
            kinds, [widths[kind] for kind in kinds], left=[left[kind] for kind in kinds], label=label, color=colour
        )
        left = {kind: left[kind] + widths[kind] for kind in kinds}
    ours = [max(0.0, statistics.median(each.to_next_s for each, *_ in spent[kind]) - left[kind]) for kind in kinds]
    axes.barh(kinds, ours, left=[left[kind] for kind in kinds], label="ours", color="black")
    axes.set_xlabel("seconds from the trigger to the next")
    axes.invert_yaxis()
    figure.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=8)
    with mpl.rc_context({"svg.hashsalt": "cycle-time"}):
        figure.savefig(CHART, metadata={"Date": None})


def recipes_measured(folder: str, way: Mapping[str, str]) -> Path:
    """Put the shipped recipes of fruit into a folder, each measured in another way."""
    place = Path(folder) / "recipes"
    shutil.copytree(ROOT / "recipes", place)
    for kind, measured in way.items():
        file = place / f"{kind}.yaml"
        text = re.sub(r"\n  measured: .*", "", file.read_text())
        file.write_text(text.replace("\nsteps:", f"\nsteps:\n  measured: {measured}", 1))
    return place


def other_way(recipe: Recipe) -> str:
    """Return the way of measuring, of the two, that the recipe does not use."""
    return "at_rest" if recipe.steps.measured == "while_closing" else "while_closing"


def configured(folder: str, way: Mapping[str, str] | None = None) -> tuple[Path, Configuration]:
    """A cell's configuration file, and its content; with the shipped recipes, or those measured in another way."""
    file = Path(folder) / "station.yaml"
    own = f"recipes_folder: {recipes_measured(folder, way)}\n" if way else ""
    file.write_text(
        f"home: {folder}\narm: {{host: {HOST}}}\n"
        f"gripper: {{urcap: {{host: {HOST}}}, modbus_rtu: {{host: {HOST}}}}}\n"
        "camera: {twin: {port: 49310}}\nmetrics: {port: 49312}\nrecords: {free_reserve_mb: 1}\n"
        f"service: {{patience: 10.0, inspection_deadline_s: null}}\n{own}"
    )
    configuration = load_configuration(file, {})
    calibrate_simulated_unit(configuration, "bench")
    return file, configuration


def inspected_otherwise(shipped: Mapping[str, Recipe]) -> dict[str, Pace]:
    """The same fruit, each measured as its shipped recipe does not."""
    with tempfile.TemporaryDirectory() as folder:
        file, configuration = configured(folder, {kind: other_way(shipped[kind]) for kind in FRUIT})
        with ended(start("twin", file, "--console", str(CONSOLE))), ended(start("service", file)):
            return asyncio.run(inspect(configuration))


def main() -> None:
    """Measure, print, and write the document and its chart."""
    shipped = load_recipes()
    other = inspected_otherwise(shipped)
    with tempfile.TemporaryDirectory() as folder:
        file, configuration = configured(folder)
        with ended(start("twin", file, "--console", str(CONSOLE))):
            with ended(start("service", file)):
                results = asyncio.run(inspect(configuration))
            spent = asyncio.run(floors(configuration, results))
    draw(spent)
    document = DOCUMENT.format(
        fruit=len(SEEDS),
        in_a_row=IN_A_ROW,
        load=os.getloadavg()[0],
        cores=os.cpu_count(),
        table="\n".join(table(shipped, results, other, spent)),
        overshoots="\n".join(overshoot_table(spent)),
        most_mm=MOST_UNSEEN_MM,
        phases="\n".join(phase_table(spent)),
    )
    print(document)
    (ROOT / "docs" / "cycle-time.md").write_text(document)
    for page in PAGES_WITH_PACE:
        write(ROOT / page, {"pace": pace_table(shipped, results, other)})


if __name__ == "__main__":
    main()
