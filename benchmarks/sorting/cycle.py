"""The station's decision on one fruit, closing by closing: centre, press step by step, judge, press twice.

The functions define what the service's cycle does with measured steps; here the steps come from a cache.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

from station.inspection.centring import Offset, too_far
from station.inspection.fruit_size import FruitSize
from station.inspection.judge import judge
from station.inspection.press import Measured, Press
from station.inspection.second_press import needs_second_press, together
from station.press.stop import ends_steps
from station.settings.arm import ArmSettings
from station.settings.gripper import GripperCalibration
from station.settings.recipe_model import Recipe
from station.vision.scale import TYPICAL_MM_PER_PX, TYPICAL_STANDARD_UNCERTAINTY
from station.vocabulary import Flag, OutcomeName, Reason

from .presses import Closing, Pressed, Step
from .specimens import CALIBRATION_SD, Specimen, Task, draw
from .sweep import FRAME_S

_ARM_MM = 0.05
"""The UR10e's repeatability by its data sheet."""

Source = Callable[[Closing], Pressed | None]
"""Gives a closing that is measured, or None."""


class Found(NamedTuple):
    """Calibration of a unit, as `station calibrate` found it."""

    unit: int
    """Seed of its light."""
    mm_per_px: float
    standard_uncertainty: float
    """Relative, of the scale."""


@dataclass(frozen=True, slots=True)
class Practice:
    """Practices of the station that are used."""

    size: str = "length"
    """`length` by the grader, `class`, or `none`."""
    centring: bool = True
    second_press: bool = True
    calibrated: bool = True
    calibrations: tuple[Found, ...] = ()
    """Of the units that press; of a unit that is not among them the result is drawn."""


@dataclass(frozen=True, slots=True)
class Inspected:
    """One fruit's outcome."""

    task: Task
    outcome: OutcomeName
    reasons: tuple[Reason, ...]
    closings: int
    """With the one that only found the first contact off the middle."""
    steps: int
    """Width steps after the onset, of all closings."""
    steps_s: float
    """What they took."""
    most_force_n: float


class Unmeasured(Exception):  # noqa: N818 (no error: a request)
    """A closing that has to be measured first."""

    def __init__(self, closing: Closing) -> None:
        super().__init__(closing)
        self.closing = closing


def inspect(task: Task, recipe: Recipe, practice: Practice, source: Source) -> Inspected:
    """Decide on one fruit as the station does.

    Args:
        task: the fruit.
        recipe: its recipe.
        practice: what of the station is used.
        source: gives measured closings.

    Raises:
        Unmeasured: a closing is not measured yet.
    """
    specimen, recipe = draw(task), sized_by(practice, recipe)
    shift_mm, closings, steps, steps_s, forces = (0.0, 0.0), 0, 0, 0.0, [0.0]
    presses: list[Press] = []

    def close() -> Pressed:
        nonlocal closings
        closing = Closing(task, closings, shift_mm)
        pressed = source(closing)
        if pressed is None:
            raise Unmeasured(closing)
        closings += 1
        return pressed

    pressed = close()
    if practice.centring and pressed.steps and (move := move_mm(pressed.steps[0], recipe, shift_mm)) is not None:
        forces.append(pressed.steps[0].force_n)
        shift_mm = move
        pressed = close()
    most_presses = recipe.press.attempts if practice.second_press else 1
    while True:
        if presses:
            last = pressed.steps[len(presses[-1].points) - 1]
            if practice.centring and (move := move_mm(last, recipe, shift_mm)) is not None:
                shift_mm = (round(shift_mm[0] + move[0], 2), round(shift_mm[1] + move[1], 2))
            pressed = close()
        press, used = as_stopped(pressed, specimen, recipe, practice, presses)
        presses.append(press)
        steps += max(0, used - 1)
        steps_s += seconds(pressed.steps[:used], recipe)
        forces += [step.force_n for step in pressed.steps[:used]]
        verdict = judge(together(presses), recipe)
        if len(presses) >= most_presses or not needs_second_press(verdict):
            break
    return Inspected(task, verdict.outcome, verdict.reasons, closings, steps, steps_s, max(forces))


def move_mm(step: Step, recipe: Recipe, shift_mm: tuple[float, float]) -> tuple[float, float] | None:
    """Return the arm's move that brings a contact to the field's middle, as the contact's way in the image, mm.

    The usual scale serves: its 9 % are a tenth of a millimetre of the way.

    Args:
        step: with the contact.
        recipe: with the offset from which on a contact is centred.
        shift_mm: the arm's moves so far, likewise.

    Returns:
        x and y, to the arm's repeatability; None where the contact is near enough, too far off, or was not seen.
    """
    from_mm = recipe.press.centre_from_mm
    if step.offset_px is None or from_mm is None:
        return None
    x_mm, y_mm = (-offset * TYPICAL_MM_PER_PX for offset in step.offset_px)
    off = Offset(x_mm, y_mm)
    if off.length_mm < from_mm or too_far(off, Offset(*shift_mm), ArmSettings().centring.most_mm):
        return None
    return round(round(x_mm / _ARM_MM) * _ARM_MM, 2), round(round(y_mm / _ARM_MM) * _ARM_MM, 2)


def as_stopped(
    pressed: Pressed, specimen: Specimen, recipe: Recipe, practice: Practice, earlier: Sequence[Press]
) -> tuple[Press, int]:
    """One closing as far as the station goes, and the number of its points.

    Args:
        pressed: what was measured.
        specimen: the fruit and its cell.
        recipe: its recipe.
        practice: which scale and size the station has.
        earlier: closings on the same fruit, which are judged with this one.
    """
    mm_per_px, scale_uncertainty = _scale(specimen, practice)
    press = Press(
        pressed.onset_mm,
        pressed.onset_uncertainty_mm,
        (),
        size=_size(specimen, recipe, practice),
        resolution_mm=GripperCalibration().mm_per_count,
        scale_uncertainty=scale_uncertainty,
    )
    ended_on_the_way = False
    for step in pressed.steps:
        press = replace(press, points=(*press.points, _measured(step, mm_per_px)))
        ends = ends_steps(together([*earlier, press]), recipe)
        # The fingers run on for about a frame: the next one is where they come to rest, and has to show it too.
        if ends and (ended_on_the_way or not step.on_the_way):
            break
        ended_on_the_way = ends
    return press, len(press.points)


def seconds(steps: Sequence[Step], recipe: Recipe) -> float:
    """Return the time of the steps after the onset, s: motion, settling and frames.

    Args:
        steps: of one closing, the onset's first; may be none.
        recipe: its recipe.
    """
    spent_s = 0.0
    for before, step in pairwise(steps):
        spent_s += (step.closing_mm - before.closing_mm) / recipe.gripper.speed_mm_s
        if not step.on_the_way:
            # Where the jaws stop after closing without a stop, nothing settles.
            spent_s += recipe.imaging.frames_per_step * FRAME_S + (
                0.0 if before.on_the_way else recipe.imaging.settle_s
            )
    return spent_s


def sized_by(practice: Practice, recipe: Recipe) -> Recipe:
    """The recipe, going by what the grader of this practice gives.

    Args:
        practice: with its size.
        recipe: as shipped.
    """
    rule = recipe.damage.size
    if practice.size != "class" or rule is None:
        return recipe
    by_class = rule.model_copy(update={"judged_by": "class"})
    return recipe.model_copy(update={"damage": recipe.damage.model_copy(update={"size": by_class})})


def _scale(specimen: Specimen, practice: Practice) -> tuple[float, float]:
    """The scale by which the station takes an area, and its standard uncertainty."""
    if not practice.calibrated:
        return TYPICAL_MM_PER_PX, TYPICAL_STANDARD_UNCERTAINTY
    found = next((one for one in practice.calibrations if one.unit == specimen.unit), None)
    return (specimen.calibrated_mm_per_px, CALIBRATION_SD) if found is None else found[1:]


def _size(specimen: Specimen, recipe: Recipe, practice: Practice) -> FruitSize:
    """Return the size that the PLC writes; without a class for a fruit outside all of the recipe's classes."""
    if practice.size == "length":
        return FruitSize(length_mm=specimen.graded_mm)
    rule = recipe.damage.size
    if practice.size == "none" or rule is None:
        return FruitSize()
    numbers = (one.number for one in rule.classes if one.smallest_mm <= specimen.graded_mm < one.largest_mm)
    return FruitSize(size_class=next(numbers, None))


def _measured(step: Step, mm_per_px: float) -> Measured:
    area_mm2 = step.area_px * mm_per_px**2
    return Measured(
        closing_mm=step.closing_mm,
        area_mm2=area_mm2,
        area_px=step.area_px,
        confidence=step.confidence,
        flags=frozenset(Flag(flag) for flag in step.flags),
    )
