"""Speed of the what-if in stored inspections a second: on one core, on two, and the judge alone beside them.

`./run bench whatif [NUMBER]` writes docs/whatif-speed.md.
"""

import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.messages.records import IMAGES_NOT_WANTED
from station.records.database import reading
from station.records.direct_transaction import direct_transaction
from station.records.model import CurvePoint, InspectionRecord, RecipeSnapshot, Trigger
from station.records.write_requests import conclude, insert_trigger
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.whatif.runner import batches, run
from station.whatif.stored import sequences, snapshots

ROOT = Path(__file__).resolve().parents[1]
MM_PER_PX, ONSET_MM, BATCH = 0.03, 35.0, 1000


def pressed(recipe: Recipe, random: np.random.Generator) -> Press:
    """A fruit of a random stiffness, pressed until the recipe stops it."""
    growth = random.normal(29, 4)
    press = Press(ONSET_MM, 0.4, ())
    points: list[Measured] = []
    for step in range(recipe.steps.number + 1):
        area_px = round(max(4.0, growth * step) * (1 + 0.002 * random.standard_normal()) / MM_PER_PX**2)
        area_mm2 = area_px * MM_PER_PX**2
        points.append(Measured(float(step), area_mm2, area_px, 0.9))
        press = replace(press, points=tuple(points))
        if early_stop(press, recipe) is not None:
            break
    return press


def fill(folder: Path, recipe: Recipe, number: int) -> None:
    """Store so many inspections."""
    random, snapshot = np.random.default_rng(1), RecipeSnapshot.of(recipe.model_dump(mode="json"), "1")
    presses = [pressed(recipe, random) for _ in range(min(number, 500))]
    for start in range(0, number, BATCH):
        with direct_transaction(folder) as connection:
            for sequence in range(start + 1, min(start + BATCH, number) + 1):
                press = presses[sequence % len(presses)]
                insert_trigger(connection, sequence, Trigger(1, 0, "A", 1, snapshot, simulated=True), "bench")
                states = {"PASS": IMAGES_NOT_WANTED(), "other": IMAGES_NOT_WANTED()}
                conclude(connection, sequence, record_of(press, recipe), states)


def record_of(press: Press, recipe: Recipe) -> InspectionRecord:
    """The record that the service would write."""
    verdict, last = judge(press, recipe), press.points[-1]
    return InspectionRecord(
        outcome=verdict.outcome,
        reasons=() if verdict.outcome == "PASS" else tuple(map(str, verdict.reasons)),
        explanation=tuple(finding.message for finding in verdict.findings),
        late=False,
        partial=verdict.partial,
        area_mm2=last.area_mm2,
        area_px=last.area_px,
        closing_mm=last.closing_mm,
        confidence=0.9,
        ended_utc_ms=1,
        duration_ms=1,
        curve=tuple(
            CurvePoint(step, ONSET_MM - point.closing_mm, point.closing_mm, point.area_mm2, point.area_px, 0.9)
            for step, point in enumerate(press.points)
        ),
        measures={"onset_mm": press.onset_mm, "onset_uncertainty_mm": 0.4},
    )


def rate(folder: Path, wanted: Sequence[int], own: dict[str, str], draft: Recipe, jobs: int) -> float:
    """Inspections a second, reading included."""
    began_s = time.perf_counter()
    done = sum(len(results) for results in run(batches(folder, wanted, own, draft), jobs, None))
    assert done == len(wanted)
    return done / (time.perf_counter() - began_s)


def main() -> None:
    """Measure and write the document."""
    load = os.getloadavg()[0]
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    recipe = find_recipe("strawberry")
    values = recipe.model_dump(mode="json")
    values["damage"]["area"][0]["area_mm2"] = 90
    draft = Recipe.model_validate_json(json.dumps(values))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fill(folder, recipe, number)
        with reading(folder) as connection:
            wanted, own = sequences(connection, recipe.name, (), None), snapshots(connection, recipe.name)
        rates = [[rate(folder, wanted, own, draft, jobs) for jobs in (1, 2)] for _ in range(2)]
        one, two = map(max, zip(*rates, strict=True))
    presses = [pressed(recipe, np.random.default_rng(1)) for _ in range(200)]
    began_s = time.perf_counter()
    for press in presses:
        judge(press, draft)
    alone = len(presses) / (time.perf_counter() - began_s)
    text = f"""# Speed of the what-if

{number} stored inspections of strawberries, judged again by a draft; `./run bench whatif` makes this page. The
better of two runs each, on {os.cpu_count()} cores with a load of {load:.0f} before: where other work fills them,
a second process gains nothing.

| | inspections/s |
|---|---|
| one process, reading the records included | {one:.0f} |
| two processes, their start included | {two:.0f} |
| the judge alone on a curve in memory, for comparison | {alone:.0f} |

Each inspection is judged by its own recipe and by the draft, and the draft's early stop is tried at every step. Where
images have to be measured again, [the measurement](speed.md) takes nearly all of the time.
"""
    print(text)
    (ROOT / "docs" / "whatif-speed.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
