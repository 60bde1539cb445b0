"""Sample of a study: a worker's task and its result."""

from typing import NamedTuple

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict

from station.settings.recipe import find_recipe
from station.settings.segmentation import Segmentation
from station.studies.cohort import member
from station.vision.median import median_image
from station.vision.methods import make_method
from station.vision.press import PressTracker


class Task(NamedTuple):
    """Task of a worker."""

    fruit: str
    method: str
    seed: int
    number: int
    """Of the sample, from 1."""


class SampleResult(BaseModel):
    """A press as it was measured, with the truth; one value an image in the order of closing."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    number: int
    """From 1, as in the paper and in all files of a study."""
    weight_g: float
    length_mm: float
    width_mm: float
    closings_mm: list[float]
    areas_px: list[int]
    true_areas_px: list[int]
    confidences: list[float | None]
    flags: list[list[str]]


def segmentation_of(fruit: str, method: str) -> Segmentation:
    """Return the segmentation of the fruit's shipped recipe, with the requested method, `paper` or `robust`."""
    return find_recipe(fruit).segmentation.model_copy(update={"method": method})


def measure_sample(task: Task) -> SampleResult:
    """Render a sample's press and measure its images as the steps of one press, on one thread."""
    cv2.setNumThreads(1)
    one = member(task.fruit, task.seed, task.number - 1)
    press = one.press()
    segmentation = segmentation_of(task.fruit, task.method)
    tracker = PressTracker(make_method(median_image(press.references), segmentation))
    contacts = [tracker.measure_step([frame]) for frame in press.frames]
    return SampleResult(
        number=task.number,
        weight_g=one.fruit.weight_g,
        length_mm=one.fruit.length_mm,
        width_mm=one.fruit.width_mm,
        closings_mm=press.closings_mm,
        areas_px=[contact.area_px for contact in contacts],
        true_areas_px=[int(np.count_nonzero(mask)) for mask in press.true_masks],
        confidences=[contact.confidence for contact in contacts],
        flags=[sorted(flag.value for flag in contact.flags) for contact in contacts],
    )
