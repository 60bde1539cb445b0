"""Closing without a stop on fruit of the twin: one frame after the other, each with the width at its capture."""

import asyncio
from collections.abc import Callable, Iterator

import numpy as np

from station.press.stop import steps_to_decide
from station.settings.gripper import GripperCalibration
from station.settings.recipe_model import Recipe
from station.studies.gauge_grip import FruitRig, Grip, Onset
from station.vision.contact import Contact
from station.vision.press import PressTracker

COUNT_MM = GripperCalibration().mm_per_count
FRAME_S = 1 / 30
JITTER_S = 0.005
"""Standard deviation of a frame's time against the gripper's reading: USB frames are stamped when they have come."""

Seen = Callable[[float, Contact], None]
"""Gets a closing, mm, and its contact."""
GoesOn = Callable[[float, Contact], bool]
"""Gets a closing, mm, and its contact; says whether the fingers may close further."""


def swept(
    tracker: PressTracker,
    rig: FruitRig,
    recipe: Recipe,
    onset: Onset,
    end_mm: float,
    generator: np.random.Generator,
) -> Iterator[tuple[float, Contact]]:
    """Close from the onset at the recipe's speed without a stop, one frame after the other.

    Args:
        tracker: measures the frames.
        rig: with the fruit.
        recipe: its speed.
        onset: where the closing counts from.
        end_mm: where the fingers end; no frame is from beyond it.
        generator: of the frames' phase and jitter.

    Yields:
        The closing as it is known, mm, and the contact.
    """
    speed_mm_s = recipe.gripper.speed_mm_s
    closing_mm = float(generator.uniform(0.0, speed_mm_s * FRAME_S))
    while closing_mm < end_mm:
        known_mm = min(closing_mm + speed_mm_s * float(generator.normal(0.0, JITTER_S)), end_mm)
        frame = rig.images_at(onset.width_mm - closing_mm, 1)[0]
        yield known_mm, tracker.measure_step([frame.image])
        closing_mm += speed_mm_s * FRAME_S


def at_count(closing_mm: float) -> float:
    """The closing that the gripper reaches."""
    return round(closing_mm / COUNT_MM) * COUNT_MM


def close_on_the_way(
    grip: Grip, rig: FruitRig, recipe: Recipe, onset: Onset, seed: int, passing: Seen, goes_on: GoesOn
) -> None:
    """Close without a stop to the last damage threshold, take that step at rest, and step on from there.

    An area that would end the motion on its way does not: whoever judges says where it ends.

    Args:
        grip: whose reference the frames are measured against.
        rig: with the fruit.
        recipe: its recipe.
        onset: where the closing counts from.
        seed: of the frames' phase and jitter.
        passing: gets each contact on the way.
        goes_on: gets each contact at rest, the onset's first.
    """
    step_mm, closed = recipe.steps.step_mm, steps_to_decide(recipe)
    target_mm = at_count(closed * step_mm)
    tracker = PressTracker(grip.method, first=onset.contact)
    goes_on(0.0, onset.contact)
    for closing_mm, contact in swept(tracker, rig, recipe, onset, target_mm, np.random.default_rng(seed)):
        passing(closing_mm, contact)
    rest_mm = target_mm
    while True:
        frames = rig.images_at(onset.width_mm - rest_mm, recipe.imaging.frames_per_step)
        if not goes_on(rest_mm, tracker.measure_step([each.image for each in frames])) or closed == recipe.steps.number:
            return
        closed += 1
        rest_mm = at_count(closed * step_mm)
        asyncio.run(rig.settle())
