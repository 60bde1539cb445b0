"""Calibrating with the ball, again and again: does its area rise, and is the sensor's scale found?

The ball is drawn by the twin with its measured noise and drift, at whole counts of the gripper; the true areas and the
true scale are known. The published pipeline measures the same frames beside the station's method, and the usual scale
is beside the measured one. Writes its tables into docs/calibration.md.
"""

import asyncio
import re
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from station.calibration import figures
from station.calibration.calibration_procedure import CalibrationProcedure, Draft
from station.calibration.errors import RefusedError
from station.calibration.rig import Place, Unit
from station.calibration.verification_procedure import VerificationProcedure
from station.press.procedure import take_step
from station.press.reference import take_reference
from station.settings.calibration import CalibrationSettings
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.settings.segmentation import Segmentation
from station.studies.simulated_rig import SimulatedRig
from station.twin.digit.codec import Image
from station.vision.median import median_image
from station.vision.methods import make_method
from station.vision.scale import TYPICAL_MM_PER_PX

REPEATS = 14
WIDTHS_MM = range(42, 34, -1)
SCALES_MM = (0.0255, 0.0266, 0.0278, 0.0291)
PLACES = (Place(-2.5, 0.0), Place(0.0, 3.0))
SPILL_MM = 0.02
SHIFTS = 6
DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "calibration.md"
UNIT = Unit("D00000", "drawn DIGIT", simulated=True)

Step = tuple[float, Image]


async def press(ball: SimulatedRig) -> tuple[list[Image], list[Step]]:
    """The paper's widths: the untouched gel's frames, then each width's mean image."""
    references = (await take_reference(ball, 5)).images
    steps = []
    for width_mm in WIDTHS_MM:
        pressed = await take_step(ball, find_recipe("rubber_ball"), 0, width_mm)
        steps.append((pressed.move.width_mm, pressed.image))
    return references, steps


def repeats() -> str:
    """Return a table of how often the area rises from 42 to 35 mm: both methods, another unit's light each time."""
    robust = find_recipe("rubber_ball").segmentation
    methods = {"robust": robust, "paper": robust.model_copy(update={"method": "paper"})}
    rising, ratios = dict.fromkeys(methods, 0), {name: [] for name in methods}
    for seed in range(REPEATS):
        ball = SimulatedRig(seed, unit=None if seed == 0 else seed, frames_per_step=3)
        references, steps = asyncio.run(press(ball))
        for name, segmentation in methods.items():
            areas = measured(references, steps, segmentation)
            rising[name] += all(after > before for before, after in pairwise(areas))
            ratios[name] += [
                area / truth
                for (width, _), area in zip(steps, areas, strict=True)
                if (truth := ball.true_area_px(width))
            ]
        print(f"repeat {seed + 1} of {REPEATS}", file=sys.stderr)
    rows = [
        f"| `{name}` | {rising[name]} of {REPEATS} | {np.median(ratios[name]):.3f} | "
        f"{np.percentile(ratios[name], 5):.3f} to {np.percentile(ratios[name], 95):.3f} |"
        for name in methods
    ]
    head = "| method | area rises at every step from 42 to 35 mm | area ÷ truth, median | 5th to 95th percentile |"
    return "\n".join([head, "|---|---|---|---|", *rows])


def measured(references: Sequence[Image], steps: Sequence[Step], segmentation: Segmentation) -> list[int]:
    """The areas of a press, px."""
    method = make_method(median_image(references), segmentation)
    return [method.measure(image).area_px for _, image in steps]


def calibrated(ball: SimulatedRig, recipe: Recipe, places: Sequence[Place]) -> Draft:
    """One calibration."""
    settings = CalibrationSettings()
    return asyncio.run(CalibrationProcedure(ball, UNIT, recipe, settings, places, "bench", "0", lambda _: None).run())


def scales(recipe: Recipe) -> tuple[str, list[Draft]]:
    """The scale found beside the true one and the usual one."""
    rows, drafts = [], []
    for seed, true_mm in enumerate(SCALES_MM):
        ball = SimulatedRig(seed, unit=seed, mm_per_px=true_mm, spill_mm=SPILL_MM, frames_per_step=3)
        try:
            draft = calibrated(ball, recipe, PLACES)
        except RefusedError as error:
            rows.append(f"| {true_mm:.4f} | refused: {error} | | | |")
            continue
        drafts.append(draft)
        found = draft.calibration
        area = (found.mm_per_px / true_mm) ** 2 - 1
        usual = (TYPICAL_MM_PER_PX / true_mm) ** 2 - 1
        known = f"{found.mm_per_px:.5f} ± {found.scale_uncertainty:.1%}"
        rows.append(f"| {true_mm:.4f} | {known} | {area:+.1%} | {usual:+.1%} | {found.zero_mm:+.2f} |")
        print(f"scale {true_mm}", file=sys.stderr)
    head = (
        "| true mm/px | found, with its uncertainty | error of an area in mm² | the same with the usual 0.0266 "
        "| gripper's zero, mm |"
    )
    return "\n".join([head, "|---|---|---|---|---|", *rows]), drafts


def shifts(recipe: Recipe, draft: Draft, true_mm: float) -> str:
    """Return a table of how far a sound sensor's verifications come from its calibration, beside the tolerances."""
    settings, golden, presses = CalibrationSettings(), draft.reference, [step.image for step in draft.steps]
    calibration = draft.calibration
    passed, ratios, contrasts, onsets = 0, [], [], []
    for seed in range(SHIFTS):
        ball = SimulatedRig(100 + seed, unit=0, mm_per_px=true_mm, frames_per_step=3)
        procedure = VerificationProcedure(ball, recipe, settings, calibration, golden, presses, "bench", lambda _: None)
        verification = asyncio.run(procedure.run()).verification
        passed += verification.passed
        ratios.append(abs((verification.area_ratio or 0.0) - 1.0))
        contrasts.append(abs((figures.ratio(verification.curve, calibration.curve, "contrast_levels") or 0.0) - 1.0))
        onsets.append(abs((verification.onset_mm or 0.0) - calibration.onset_mm))
    rows = [
        f"| the ball's area | {max(ratios):.1%} | {settings.area_tolerance:.0%} |",
        f"| contrast | {max(contrasts):.1%} | {1 - settings.least_contrast:.0%} |",
        f"| onset | {max(onsets):.2f} mm | {settings.onset_tolerance_mm:g} mm |",
    ]
    head = f"| {passed} of {SHIFTS} passed; of | largest change | tolerance |"
    return "\n".join([head, "|---|---|---|", *rows])


def write(name: str, table: str) -> None:
    """Put a table between its marks in the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    marks = re.compile(rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)", re.DOTALL)
    DOCUMENT.write_text(marks.sub(lambda match: f"{match[1]}{table}\n{match[2]}", text), encoding="utf-8")
    print(table)


def main() -> None:
    """Measure, print, write."""
    cv2.setNumThreads(1)
    recipe = find_recipe("rubber_ball")
    write("rising", repeats())
    table, drafts = scales(recipe)
    write("scale", table)
    write("shifts", shifts(recipe, drafts[0], SCALES_MM[0]))


if __name__ == "__main__":
    main()
