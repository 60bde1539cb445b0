"""The robust method on presses of the twin, where the truth is exact."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from measurement.peers import PEER, contact_area_idea, methods
from station.settings.segmentation import RobustParameters
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.press import PressOptions
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import Fruit, draw_fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Image
from station.vision.median import median_image
from station.vision.press import PressTracker
from station.vision.robust import RobustMethod
from station.vision.step import mean_image, measure_step
from station.vision.working import working_image
from station.vocabulary import Flag

CLOSINGS_MM = (0.0, 0.1, 0.2, 0.4, 0.8, 1.2, 1.8, 2.5, 3.5, 5.0, 7.0)
PEER_CLOSINGS_MM = (0.0, 0.4, 1.2, 2.5, 5.0)
"""Fewer than for the robust method alone: the paper's takes half a second an image."""
FRUITS = ("strawberry", "raspberry", "blueberry", "rubber_ball")
FRAMES_PER_STEP = 3
"""As in the recipes; the station measures their mean."""
FRAMES_PER_S = 30.0
TWIN_SEEDS = (94_000, 94_100)
"""Of the first press of each fruit. Nothing was chosen on them."""
BRUISED_FRUITS = FRUITS[:3]
BRUISED_SEEDS = (95_000, 95_100)
"""As `TWIN_SEEDS`."""
FIRM_MM2 = 20
LARGE_ERROR = 0.25

Floats = npt.NDArray[np.float64]


def conditions() -> dict[str, PressOptions]:
    """Return the conditions of the twin's presses, by name."""
    return {
        "plain": PressOptions(),
        "another unit": PressOptions(unit=7),
        "at the border": PressOptions(pose=Pose(x_px=70.0)),
        "tilted": PressOptions(pose=Pose(tilt_deg=10.0, turn_deg=40.0)),
        "drift doubled": PressOptions(drift=2.0, unit=11),
        "dead LED": PressOptions(condition=Condition(dead_led="red")),
        "dirt on the gel": PressOptions(condition=Condition(dirt=3)),
    }


class Step(NamedTuple):
    """One width step of a simulated press."""

    frames: list[Image]
    true_px: int
    true_mm2: float
    is_cut: bool
    """Whether the border cuts the contact."""


class Press(NamedTuple):
    """A simulated press as the station sees it."""

    references: list[Image]
    steps: list[Step]


def squeezed(
    kind: str,
    seed: int,
    closings_mm: Sequence[float],
    options: PressOptions,
    *,
    bruised: bool = False,
    frames_per_step: int = FRAMES_PER_STEP,
) -> Press:
    """A press as `render_press` draws it, with as many frames a step as a recipe takes, or as wanted."""
    fruit, gel = replace(draw_fruit(kind, seed), bruised=bruised), Gel()
    sensor = DigitSensor(seed, options.unit, options.noise, options.drift)
    on_gel = FruitOnGel(fruit, options.pose, gel)
    press = Press([sensor.frame(None, k / FRAMES_PER_S, options.condition) for k in range(options.references)], [])
    for number, closing_mm in enumerate(closings_mm):
        seen = on_gel.pressed(Squeeze(fruit, gel, held_s=number * options.step_s).at(closing_mm))
        began_s = options.references / FRAMES_PER_S + (number + 1) * options.step_s
        times_s = [began_s + k / FRAMES_PER_S for k in range(frames_per_step)]
        frames = [sensor.frame(seen.dent, now_s, options.condition) for now_s in times_s]
        rim = (seen.true_mask[[0, -1]], seen.true_mask[:, [0, -1]])
        press.steps.append(Step(frames, seen.true_area_px, seen.true_area_mm2, any(side.any() for side in rim)))
    return press


def squeezed_with_masks(
    fruit: Fruit, seed: int, options: PressOptions, closings_mm: Sequence[float] = CLOSINGS_MM
) -> tuple[list[Image], list[Image], list[npt.NDArray[np.bool_]]]:
    """The references, the steps' mean images and the true masks of a press, all at the working size."""
    gel = Gel()
    sensor = DigitSensor(seed, options.unit, options.noise, options.drift)
    on_gel = FruitOnGel(fruit, options.pose, gel)
    references = [sensor.frame(None, k / FRAMES_PER_S, options.condition) for k in range(options.references)]
    images: list[Image] = []
    truths: list[npt.NDArray[np.bool_]] = []
    for number, closing_mm in enumerate(closings_mm):
        seen = on_gel.pressed(Squeeze(fruit, gel, held_s=number * options.step_s).at(closing_mm))
        began_s = options.references / FRAMES_PER_S + (number + 1) * options.step_s
        frames = [
            sensor.frame(seen.dent, began_s + k / FRAMES_PER_S, options.condition) for k in range(FRAMES_PER_STEP)
        ]
        images.append(working_image(mean_image(frames)))
        shape = images[-1].shape
        small = cv2.resize(np.asarray(seen.true_mask, np.uint8), (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
        truths.append(small > 127)
    return [working_image(one) for one in references], images, truths


def twin_presses(seed: int, kinds: Sequence[str], *, bruised: bool) -> Iterator[tuple[str, str, Press]]:
    """Bodies in seven conditions, from the first touch to a firm grip."""
    for kind in kinds:
        for number, (name, options) in enumerate(conditions().items()):
            yield kind, name, squeezed(kind, seed + number, CLOSINGS_MM, options, bruised=bruised)


class Measured(NamedTuple):
    """One step of the twin: its keys in the table, and what was found against the truth."""

    keys: tuple[str, str]
    followed: bool
    """Measured as a step of its press, as the station does it, or by itself."""
    press: int
    true_mm2: float
    error: float
    single_error: float
    """Of the step's first frame alone."""
    area_px: int
    peer_error: float
    """Of the idea of PyTouch's contact area, on the mean image."""
    peer_px: int
    judged: bool
    """Whether the station would judge it: sure enough, and decided."""
    undecided: bool
    lower_bound: bool
    """Whether the area is only what is in contact at least."""


def measured_presses(seeds: Sequence[int], kinds: Sequence[str] = FRUITS, *, bruised: bool = False) -> list[Measured]:
    """Every step of the twin's presses with those seeds."""
    found: list[Measured] = []
    parameters = RobustParameters()
    for seed in seeds:
        for number, (kind, name, press) in enumerate(twin_presses(seed, kinds, bruised=bruised)):
            reference = median_image(press.references)
            method, peer = RobustMethod(reference, parameters), contact_area_idea(reference)
            tracker = PressTracker(method)
            for step in press.steps:
                contacts = {True: tracker.measure_step(step.frames), False: measure_step(method, step.frames)}
                single_px = method.measure(step.frames[0]).area_px
                peer_px = int(np.count_nonzero(peer(mean_image(step.frames))))
                for followed, contact in contacts.items():
                    areas_px = (contact.area_px, single_px, peer_px)
                    error, single_error, peer_error = (abs(px / max(1, step.true_px) - 1) for px in areas_px)
                    undecided = Flag.UNDECIDED in contact.flags
                    judged = not undecided and Flag.LOW_CONFIDENCE not in contact.flags
                    found.append(
                        Measured(
                            (kind, name),
                            followed,
                            1000 * seed + number,
                            step.true_mm2,
                            error,
                            single_error,
                            contact.area_px,
                            peer_error,
                            peer_px,
                            judged,
                            undecided,
                            Flag.LOWER_BOUND in contact.flags,
                        )
                    )
    return found


def twin_table() -> list[str]:
    """The robust method on the twin, where the truth is exact."""
    every = measured_presses(TWIN_SEEDS)
    found = [one for one in every if one.followed]
    large = [one for one in found if one.true_mm2 > 2]
    light, firm = ([one.error for one in large if (one.true_mm2 > FIRM_MM2) == heavy] for heavy in (False, True))
    single = [one.single_error for one in large]
    before = [one for one in found if one.true_mm2 == 0]
    missed = [one for one in large if one.area_px == 0]
    wrong, right = ([one for one in large if (one.error > LARGE_ERROR) == much] for much in (True, False))
    flagged = [np.mean([not one.judged for one in some]) for some in (wrong, right)]
    return [
        *errors_table(every, ("all", *FRUITS, *conditions())),
        "",
        f"Median and p95 up to {FIRM_MM2} mm²: {median_and_p95(light, ' and ')};",
        f"over it: {median_and_p95(firm, ' and ')}.",
        lower_bounds(large),
        f"With one frame a step instead of {FRAMES_PER_STEP}: {median_and_p95(single, ' and ')}.",
        f"Of the {len(wrong)} areas that are wrong by more than {LARGE_ERROR:.0%}, {flagged[0]:.0%} are flagged;",
        f"of the {len(right)} others, {flagged[1]:.0%}.",
        f"False contacts before the first touch: {sum(one.area_px > 0 for one in before)} of {len(before)}.",
        f"Contacts over 2 mm² without an area: {len(missed)}, of which {sum(one.undecided for one in missed)} are",
        "flagged `undecided`.",
    ]


def bruised_table() -> list[str]:
    """As `twin_table`, of bruised fruit: softer, so that they touch more of the gel and less firmly."""
    every = measured_presses(BRUISED_SEEDS, BRUISED_FRUITS, bruised=True)
    large = [one for one in every if one.followed and one.true_mm2 > 2]
    wrong = [one for one in large if one.error > LARGE_ERROR]
    light, firm = ([one.error for one in large if (one.true_mm2 > FIRM_MM2) == heavy] for heavy in (False, True))
    flagged = np.mean([not one.judged for one in wrong])
    return [
        *errors_table(every, ("all", *BRUISED_FRUITS)),
        "",
        f"Median and p95 up to {FIRM_MM2} mm²: {median_and_p95(light, ' and ')};",
        f"over it: {median_and_p95(firm, ' and ')}.",
        lower_bounds(large),
        f"Of the {len(wrong)} areas that are wrong by more than {LARGE_ERROR:.0%}, {flagged:.0%} are flagged.",
    ]


def lower_bounds(rows: Sequence[Measured]) -> str:
    """The errors without areas that say no more than at least so much."""
    others = [one.error for one in rows if not one.lower_bound]
    return f"Without the {len(rows) - len(others)} flagged as a lower bound: {median_and_p95(others, ' and ')}."


def errors_table(found: Sequence[Measured], keys: Sequence[str]) -> list[str]:
    """The errors of all that any of the keys names, followed and at last by itself, and of what would be judged."""
    header = (
        "| contacts over 2 mm² | steps | error of the area: median | p95 | judged | their median | their p95 "
        "| Spearman with closing: median | 0.99 or more | of the judged |"
    )
    lines = [header, "|---|---|---|---|---|---|---|---|---|---|"]
    large, alone = (
        [one for one in found if one.true_mm2 > 2 and one.followed is followed] for followed in (True, False)
    )
    sets = {key: [one for one in large if key == "all" or key in one.keys] for key in keys}
    for key, rows in {**sets, "all, each step by itself": alone}.items():
        judged = [one for one in rows if one.judged]
        ranks, sure = (ranks_of(some, {one.press for one in rows}) for some in (rows, judged))
        lines.append(
            f"| {key} | {len(rows)} | {median_and_p95([one.error for one in rows])} "
            f"| {len(judged) / len(rows):.0%} | {median_and_p95([one.error for one in judged])} "
            f"| {np.median(ranks):.3f} | {np.mean(ranks >= 0.99):.0%} | {np.mean(sure >= 0.99):.0%} |"
        )
    ranks = ranks_of([one._replace(area_px=one.peer_px) for one in large], {one.press for one in large})
    lines.append(
        f"| {PEER}, all | {len(large)} | {median_and_p95([one.peer_error for one in large])} | | | "
        f"| {np.median(ranks):.3f} | {np.mean(ranks >= 0.99):.0%} | |"
    )
    return lines


def peers_table() -> list[str]:
    """All methods on the mean images of some steps of every press of the first seed."""
    areas: dict[str, list[list[int]]] = {}
    truths: list[list[int]] = []
    for kind in FRUITS:
        for number, options in enumerate(conditions().values()):
            press = squeezed(kind, TWIN_SEEDS[0] + number, PEER_CLOSINGS_MM, options)
            truths.append([step.true_px for step in press.steps])
            for name, measure in methods(median_image(press.references)).items():
                masks = [measure(mean_image(step.frames)) for step in press.steps]
                areas.setdefault(name, []).append([int(np.count_nonzero(mask)) for mask in masks])
    true = np.array(truths)
    large = true > 2 / MM_PER_PX**2
    header = (
        f"| {np.count_nonzero(large)} contacts over 2 mm² | area over truth: median, p10 to p90 | error: median | p95 "
        "| Spearman with closing: median | 0.99 or more | area where nothing touches |"
    )
    lines = [header, "|---|---|---|---|---|---|---|"]
    for name, found in areas.items():
        measured = np.array(found)
        ratio = measured[large] / true[large]
        ranks = np.array([spearman(row[seen].tolist()) for row, seen in zip(measured, large, strict=True)])
        empty = measured[true == 0]
        lines.append(
            f"| {name} | {np.median(ratio):.2f}, {np.quantile(ratio, 0.1):.2f} to {np.quantile(ratio, 0.9):.2f} "
            f"| {median_and_p95(list(np.abs(ratio - 1)))} | {np.median(ranks):.3f} | {np.mean(ranks >= 0.99):.0%} "
            f"| {np.count_nonzero(empty)} of {len(empty)} |"
        )
    closings = ", ".join(f"{closing_mm:g}" for closing_mm in PEER_CLOSINGS_MM[1:])
    return [
        *lines,
        "",
        f"The mean images at {closings} mm of closing of the presses with the first seeds, four fruit in seven",
        "conditions; every area counts, flagged or not.",
    ]


def median_and_p95(errors: list[float], between: str = " | ") -> str:
    """Both, for a table's row or a sentence."""
    return f"{np.median(errors):.3f}{between}{np.quantile(errors, 0.95):.3f}"


def ranks_of(rows: list[Measured], presses: set[int]) -> Floats:
    """The rank correlation of each press's areas with the closing."""
    return np.array([spearman([one.area_px for one in rows if one.press == press]) for press in sorted(presses)])


def spearman(values: list[int]) -> float:
    """Rank correlation of a sequence with its order; 1 where it never falls."""
    if len(values) < 2:
        return 1.0
    ranks = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return float(np.corrcoef(ranks, np.arange(len(values)))[0, 1])
