"""Measuring while the jaws close, beside the stepped press, on fruit of the twin with its creep.

Run with `./run bench sweep [--count N]`; writes the table of `docs/decisions/0060-stepped-measurement-at-rest.md`.
The same fruit, unit, noise and onset: once stepped as by the recipe, once closed at the gripper's slowest speed with
one frame every 1/30 s, each with the width at its capture, known to the jitter of a frame's time. Compared are the
areas at the damage limits' closings.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from sorting.specimens import CALIBRATION_SD, KINDS, Task, draw

from station.inspection.fruit_size import FruitSize
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.inspection.uncertainty import budget_at
from station.settings.gripper import GripperCalibration
from station.settings.recipe import Recipe, find_recipe
from station.studies.gauge_grip import FruitRig, Grip, Onset
from station.studies.workers import on_this_machine
from station.vision.contact import Contact
from station.vision.press import PressTracker

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "decisions" / "0060-stepped-measurement-at-rest.md"
BEGIN, END = "<!-- measured -->\n", "<!-- /measured -->"
GROUPS = ("sound", "severe")
FRAME_S = 1 / 30
JITTER_S = 0.005
"""Standard deviation of a frame's time against the gripper's reading: USB frames are stamped when they have come."""


def swept(
    grip: Grip, rig: FruitRig, recipe: Recipe, onset: Onset, deepest_mm: float, generator: np.random.Generator
) -> Iterator[tuple[float, Contact]]:
    """Close from the onset at the recipe's speed without a stop, one frame after the other.

    Args:
        grip: whose reference the frames are measured against.
        rig: with the fruit.
        recipe: its speed.
        onset: where the closing counts from.
        deepest_mm: the last closing.
        generator: of the frames' phase and jitter.

    Yields:
        The closing as it is known, mm, and the contact.
    """
    speed_mm_s = recipe.gripper.speed_mm_s
    tracker = PressTracker(grip.method, recipe.segmentation.robust.least_confidence, first=onset.contact)
    closing_mm = float(generator.uniform(0.0, speed_mm_s * FRAME_S))
    while closing_mm < deepest_mm + speed_mm_s * FRAME_S:
        known_mm = closing_mm + speed_mm_s * float(generator.normal(0.0, JITTER_S))
        frame = rig.images_at(onset.width_mm - closing_mm, 1)[0]
        yield known_mm, tracker.measure_step([frame.image])
        closing_mm += speed_mm_s * FRAME_S


class Pair(NamedTuple):
    """The area of one fruit at one closing, by both ways."""

    task: Task
    closing_mm: float
    ratio: float
    """Swept over stepped."""
    trusted: bool
    """Both are."""
    band: float
    """The guard band of the stepped one, as a share of the area."""


def compare(task: Task) -> list[Pair]:
    """Press one fruit both ways.

    Args:
        task: which.
    """
    cv2.setNumThreads(1)
    one, recipe = draw(task), find_recipe(task.kind)
    pose = one.pose

    def begun() -> tuple[Grip, FruitRig, Onset | None]:
        rig = FruitRig(one.fruit, pose, one.unit, one.noise_seed, one.mm_per_px)
        grip = Grip(recipe, rig)
        return grip, rig, grip.approach(one.phase)

    closings_mm = [limit.closing_mm for limit in recipe.damage.area]
    (stepped, _, onset), (grip, rig, _) = begun(), begun()
    if onset is None:
        return []
    steps: list[tuple[float, Contact]] = []

    def goes_on(closing_mm: float, contact: Contact) -> bool:
        steps.append((closing_mm, contact))
        return closing_mm <= closings_mm[-1]

    stepped.close(onset, goes_on)
    on_the_way = swept(grip, rig, recipe, onset, closings_mm[-1], np.random.default_rng(one.noise_seed))
    frames = [(0.0, onset.contact), *on_the_way]
    size = FruitSize(length_mm=one.graded_mm)
    count_mm = GripperCalibration().mm_per_count
    press = Press(onset.width_mm, onset.uncertainty_mm, (), (), size, count_mm, CALIBRATION_SD)
    limits = sized_limits(press, recipe)
    pairs = []
    for closing_mm in closings_mm:
        areas = [area_at(closing_mm, points) for points in (steps, frames)]
        if min(areas) > 0:
            near = [min(points, key=lambda each: abs(each[0] - closing_mm))[1] for points in (steps, frames)]
            band = budget_at(closing_mm, press, limits).expanded
            pairs.append(Pair(task, closing_mm, areas[1] / areas[0], not any(each.flags for each in near), band))
    return pairs


def area_at(closing_mm: float, points: list[tuple[float, Contact]]) -> float:
    """The area at a closing, px, interpolated."""
    ordered = sorted(points, key=lambda each: each[0])
    return float(np.interp(closing_mm, [each[0] for each in ordered], [each[1].area_px for each in ordered]))


def main() -> None:
    """Compare, print the table, and put it into the decision."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="fruit of each kind and group")
    parser.add_argument("--processes", type=int, default=2)
    asked = parser.parse_args()
    tasks = [Task(kind, group, "tuning", number) for kind in KINDS for group in GROUPS for number in range(asked.count)]
    pairs: list[Pair] = []
    for done, found in enumerate(on_this_machine(compare, tasks, asked.processes), 1):
        pairs += found
        print(f"\r{done} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    names = ("fruit", "closing, mm", "damage", "pairs, both trusted", "swept over stepped: median")
    more = ("standard deviation", "guard band of the stepped press", "pairs farther apart than it")
    lines = [f"| {' | '.join((*names, *more))} |", "|---" * 8 + "|"]
    for kind in KINDS:
        for closing_mm in [limit.closing_mm for limit in find_recipe(kind).damage.area]:
            for group in GROUPS:
                group_pairs = [
                    pair for pair in pairs if pair.task[:2] == (kind, group) and pair.closing_mm == closing_mm
                ]
                trusted = [pair for pair in group_pairs if pair.trusted]
                logs = np.log([pair.ratio for pair in trusted])
                far = sum(abs(pair.ratio - 1) > pair.band for pair in trusted)
                lines.append(
                    f"| {kind} | {closing_mm:g} | {group} | {len(trusted)} of {len(group_pairs)} | "
                    f"{np.exp(np.median(logs)):.3f} | {logs.std():.3f} | {trusted[0].band:.3f} | {far} |"
                )
    table = "\n".join(lines) + "\n"
    print(table)
    text = DOCUMENT.read_text()
    DOCUMENT.write_text(text[: text.index(BEGIN) + len(BEGIN)] + table + text[text.index(END) :])


if __name__ == "__main__":
    main()
