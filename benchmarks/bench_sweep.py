"""Measuring while the jaws close, beside the stepped press, on fruit of the twin with its creep.

Run with `./run bench sweep [--count N]`; writes the tables of `docs/decisions/0060-stepped-measurement-at-rest.md` and
`docs/decisions/0063-measurement-while-the-jaws-close.md`. The same fruit, unit, noise and onset: once stepped as by the
recipe, once closed at the gripper's slowest speed with one frame every 1/30 s, each with the width at its capture,
known to the jitter of a frame's time. Compared are the areas at the damage limits' closings, and the force on the fruit
where each way ends.
"""

import argparse
import asyncio
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from sections import write
from sorting.specimens import CALIBRATION_SD, KINDS, Specimen, Task, draw
from sorting.sweep import COUNT_MM, FRAME_S, at_count, swept

from station.inspection.fruit_size import FruitSize
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.inspection.uncertainty import budget_at
from station.press.measurement import measured_point
from station.press.stop import ends_steps, steps_to_decide
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.studies.gauge_grip import FruitRig, Grip, Onset
from station.studies.workers import on_this_machine
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Contact
from station.vision.press import PressTracker

DECISIONS = Path(__file__).resolve().parents[1] / "docs" / "decisions"
AREAS = DECISIONS / "0060-stepped-measurement-at-rest.md"
FORCES = DECISIONS / "0063-measurement-while-the-jaws-close.md"
GROUPS = ("sound", "severe")
RUNS_ON_MM = 0.7
"""So far the fingers run on after the frame that stops them: the most that was measured, docs/cycle-time.md."""


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

    def approached() -> tuple[Grip, FruitRig, Onset | None]:
        rig = FruitRig(one.fruit, pose, one.unit, one.noise_seed, one.mm_per_px)
        grip = Grip(recipe, rig)
        return grip, rig, grip.approach(one.phase)

    closings_mm = [limit.closing_mm for limit in recipe.damage.area]
    (stepped, _, onset), (grip, rig, _) = approached(), approached()
    if onset is None:
        return []
    steps: list[tuple[float, Contact]] = []

    def goes_on(closing_mm: float, contact: Contact) -> bool:
        steps.append((closing_mm, contact))
        return closing_mm <= closings_mm[-1]

    stepped.close(onset, goes_on)
    tracker = PressTracker(grip.method, first=onset.contact)
    # One frame more, since the area at the last closing is interpolated.
    end_mm = closings_mm[-1] + recipe.gripper.speed_mm_s * FRAME_S
    on_the_way = swept(tracker, rig, recipe, onset, end_mm, np.random.default_rng(one.noise_seed))
    frames = [(0.0, onset.contact), *on_the_way]
    press = press_of(one, onset)
    limits = sized_limits(press, recipe)
    pairs = []
    for closing_mm in closings_mm:
        areas = [area_at(closing_mm, points) for points in (steps, frames)]
        if min(areas) > 0:
            near = [min(points, key=lambda each: abs(each[0] - closing_mm))[1] for points in (steps, frames)]
            band = budget_at(closing_mm, press, limits).expanded
            pairs.append(Pair(task, closing_mm, areas[1] / areas[0], not any(each.flags for each in near), band))
    return pairs


def press_of(one: Specimen, onset: Onset) -> Press:
    """A press on a fruit without its points yet."""
    size = FruitSize(length_mm=one.graded_mm)
    return Press(onset.width_mm, onset.uncertainty_mm, (), (), size, COUNT_MM, CALIBRATION_SD)


class Borne(NamedTuple):
    """Last closings and true forces of one fruit's first press: by steps, and while closing."""

    task: Task
    stepped_mm: float
    closing_mm: float
    """The last closing while closing."""
    stepped_n: float
    closing_n: float


def bear(task: Task) -> Borne | None:
    """Press one fruit both ways until no further step can change the outcome.

    Args:
        task: which.

    Returns:
        The true forces, with the flesh's creep until the last closing was reached; None where nothing was touched.
    """
    cv2.setNumThreads(1)
    one, recipe = draw(task), find_recipe(task.kind)

    def approached() -> tuple[FruitRig, Grip]:
        rig = FruitRig(one.fruit, one.pose, one.unit, one.noise_seed, one.mm_per_px)
        return rig, Grip(recipe, rig)

    _, grip = approached()
    onset = grip.approach(one.phase)
    if onset is None:
        return None
    press = press_of(one, onset)
    last_mm, steps = 0.0, -1

    def goes_on(closing_mm: float, contact: Contact) -> bool:
        nonlocal press, last_mm, steps
        press = replace(press, points=(*press.points, measured_point(contact, closing_mm, one.calibrated_mm_per_px)))
        last_mm, steps = closing_mm, steps + 1
        return not ends_steps(press, recipe)

    grip.close(onset, goes_on)
    rig, grip = approached()
    deepest_mm, more_steps = closed_on(one, recipe, onset, rig, grip)
    speed_mm_s, step_s = recipe.gripper.speed_mm_s, recipe.imaging.settle_s + recipe.imaging.frames_per_step * FRAME_S
    late_mm = one.fruit.width_mm - onset.width_mm

    def force_n(closing_mm: float, rests: int) -> float:
        held_s = closing_mm / speed_mm_s + rests * step_s
        return Squeeze(one.fruit, Gel(mm_per_px=one.mm_per_px), held_s).at(late_mm + closing_mm).force_n

    return Borne(task, last_mm, deepest_mm, force_n(last_mm, steps - 1), force_n(deepest_mm, more_steps))


def closed_on(one: Specimen, recipe: Recipe, onset: Onset, rig: FruitRig, grip: Grip) -> tuple[float, int]:
    """Close without a stop as the station does, and on by steps where the image at rest does not decide.

    Args:
        one: the fruit.
        recipe: its recipe.
        onset: where the closing counts from.
        rig: with the fruit.
        grip: whose reference the frames are measured against.

    Returns:
        The last closing, mm, and how many steps at rest came before it.
    """
    step_mm, number = recipe.steps.step_mm, recipe.imaging.frames_per_step
    target_mm = at_count(steps_to_decide(recipe) * step_mm)
    tracker = PressTracker(grip.method, first=onset.contact)
    press = press_of(one, onset)

    def ends(closing_mm: float, contact: Contact) -> bool:
        nonlocal press
        press = replace(press, points=(*press.points, measured_point(contact, closing_mm, one.calibrated_mm_per_px)))
        return ends_steps(press, recipe)

    ends(0.0, onset.contact)
    rest_mm, closed = target_mm, steps_to_decide(recipe)
    way = swept(tracker, rig, recipe, onset, target_mm, np.random.default_rng(one.noise_seed))
    for closing_mm, contact in way:
        if ends(closing_mm, contact):
            rest_mm, closed = min(closing_mm + RUNS_ON_MM, target_mm), max(1, int(closing_mm / step_mm))
            break
    steps = 0
    while True:
        frames = rig.images_at(onset.width_mm - rest_mm, number)
        if ends(rest_mm, tracker.measure_step([each.image for each in frames])) or closed == recipe.steps.number:
            return rest_mm, steps
        steps, closed = steps + 1, closed + 1
        rest_mm = at_count(closed * step_mm)
        asyncio.run(rig.settle())


def force_table(borne: Sequence[Borne]) -> list[str]:
    """The forces by kind and group."""
    names = ("fruit", "damage", "pairs", "stepped, N: median, most", "while closing, N: median, most")
    more = ("while closing over stepped: median", "95 % of the pairs under", "decided at another closing")
    lines = [f"| {' | '.join((*names, *more))} |", "|---" * 8 + "|"]
    for kind in KINDS:
        for group in GROUPS:
            pairs = [each for each in borne if each.task[:2] == (kind, group)]
            ratios = [each.closing_n / each.stepped_n for each in pairs]
            stepped, closing = [each.stepped_n for each in pairs], [each.closing_n for each in pairs]
            other = sum(abs(each.closing_mm - each.stepped_mm) > COUNT_MM for each in pairs)
            lines.append(
                f"| {kind} | {group} | {len(pairs)} | {np.median(stepped):.2f}, {max(stepped):.2f} | "
                f"{np.median(closing):.2f}, {max(closing):.2f} | {np.median(ratios):.2f} | "
                f"{np.percentile(ratios, 95):.2f} | {other} |"
            )
    return lines


def area_at(closing_mm: float, points: list[tuple[float, Contact]]) -> float:
    """The area at a closing, px, interpolated."""
    ordered = sorted(points, key=lambda each: each[0])
    return float(np.interp(closing_mm, [each[0] for each in ordered], [each[1].area_px for each in ordered]))


def both(task: Task) -> tuple[list[Pair], Borne | None]:
    """Compare areas and forces of one fruit."""
    return compare(task), bear(task)


def area_table(pairs: Sequence[Pair]) -> list[str]:
    """The areas by kind, closing and group."""
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
    return lines


def main() -> None:
    """Compare, print the tables, and put them into the decisions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="fruit of each kind and group")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    tasks = [
        Task(kind, group, "tuning", number) for kind in KINDS for group in GROUPS for number in range(options.count)
    ]
    pairs: list[Pair] = []
    borne: list[Borne] = []
    for done, (found, force) in enumerate(on_this_machine(both, tasks, options.processes), 1):
        pairs += found
        borne += [] if force is None else [force]
        print(f"\r{done} of {len(tasks)}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    areas, forces = area_table(pairs), force_table(borne)
    print("\n".join([*areas, "", *forces]))
    write(AREAS, {"measured": areas})
    write(FORCES, {"forces": forces})


if __name__ == "__main__":
    main()
