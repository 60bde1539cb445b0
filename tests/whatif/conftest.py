"""Records full of pressed fruit, whose curves follow from one number each, judged as the station would have."""

import asyncio
import itertools
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.records.model import CurvePoint, Image, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe
from station.settings.records import RecordsSettings
from station.vocabulary import Reason
from tests.command_line import call

RECIPES = Path(__file__).parents[1] / "recipe_store" / "golden" / "form_1"
MM_PER_PX = 0.03
ONSET_MM = 35.0


@dataclass
class Orchard:
    """Makes fruit and stores their inspections."""

    folder: Path
    recipe: Recipe

    def press(self, growth: float, *reasons: Reason, seed: int = 0) -> Press:
        """A fruit whose area grows so much a millimetre, pressed until the recipe stops it."""
        random, points = np.random.default_rng(seed), []
        press = Press(ONSET_MM, 0.4, (), reasons)
        for step in range(self.recipe.steps.number + 1):
            area_mm2 = max(4.0, growth * step) * (1 + 0.002 * random.standard_normal())
            area_px = round(area_mm2 / MM_PER_PX**2)
            area_mm2 = area_px * MM_PER_PX**2
            points.append(Measured(float(step), area_mm2, area_px, 0.9))
            press = replace(press, points=tuple(points))
            if early_stop(press, self.recipe) is not None:
                break
        return press

    def store(self, presses: Sequence[Press], lot: str = "A", images: Sequence[tuple[Image, ...]] = ()) -> list[int]:
        """Store inspections as the service does; their sequences."""

        async def steps() -> list[int]:
            settings = RecordsSettings(deadline_s=30.0, free_reserve_mb=1, accepted_share=1.0)
            records = await Records.open(self.folder, settings, "boot")
            try:
                made = [await self._one(records, *each, lot) for each in itertools.zip_longest(presses, images)]
                while records.status().images_waiting:
                    await asyncio.sleep(0.01)
                return made
            finally:
                await records.close()

        return asyncio.run(steps())

    async def _one(self, records: Records, press: Press, images: tuple[Image, ...] | None, lot: str) -> int:
        snapshot = RecipeSnapshot.of(self.recipe.model_dump(mode="json"), "1")
        sequence = await records.begin(Trigger(1, 0, lot, 1_700_000_000_000, snapshot, True, *_size(press)))
        verdict = judge(press, self.recipe)
        last = press.points[-1] if press.points else None
        await records.conclude(
            sequence,
            InspectionRecord(
                outcome=verdict.outcome,
                reasons=() if verdict.outcome == "PASS" else tuple(map(str, verdict.reasons)),
                explanation=tuple(finding.message for finding in verdict.findings),
                late=False,
                partial=verdict.partial,
                area_mm2=last.area_mm2 if last else None,
                area_px=last.area_px if last else None,
                closing_mm=last.closing_mm if last else None,
                confidence=0.9,
                ended_utc_ms=1_700_000_003_000,
                duration_ms=3000,
                curve=tuple(
                    CurvePoint(step, ONSET_MM - p.closing_mm, p.closing_mm, p.area_mm2, p.area_px, p.confidence)
                    for step, p in enumerate(press.points)
                ),
                measures={
                    "onset_mm": press.onset_mm,
                    "onset_uncertainty_mm": press.onset_uncertainty_mm,
                    "scale_uncertainty": press.scale_uncertainty,
                    "gripper_resolution_mm": press.resolution_mm,
                },
                images=images or (),
            ),
        )
        return sequence


def _size(press: Press) -> tuple[int, int]:
    """As the PLC writes it."""
    return round(10 * (press.size.length_mm or 0.0)), press.size.size_class or 0


@pytest.fixture
def orchard(tmp_path: Path) -> Orchard:
    """By a release's recipe, which no later tuning of the shipped ones changes."""
    return Orchard(tmp_path / "home" / "records", find_recipe("strawberry", RECIPES))


def with_values(recipe: Recipe, **changes: object) -> Recipe:
    """A recipe with other values, each by its path with double underscores."""
    values: Any = recipe.model_dump(mode="json")
    for path, value in changes.items():
        inner = values
        *parts, last = path.split("__")
        for part in parts:
            inner = inner[int(part) if part.isdigit() else part]
        inner[last] = value
    return Recipe.model_validate_json(json.dumps(values))


@pytest.fixture
def changed() -> Callable[..., Recipe]:
    return with_values


@pytest.fixture
def draft(tmp_path: Path, orchard: Orchard) -> Callable[..., Path]:
    """Write the recipe with other values into a file."""

    def write(**changes: object) -> Path:
        file = tmp_path / "draft.yaml"
        file.write_text(with_values(orchard.recipe, **changes).model_dump_json())
        return file

    return write


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """Run the command line; return its exit code and its output."""
    monkeypatch.setenv("STATION_RECIPES_FOLDER", str(RECIPES))
    monkeypatch.setenv("STATION_HOME", str(tmp_path / "home"))
    return call


_WITHOUT_WAITING = """
from station.cli import main
from station.whatif import runner
if __name__ == "__main__":
    runner.CHUNK, runner._ALONE_S = 10, 0.0
    main()
"""


@pytest.fixture
def apart(tmp_path: Path) -> Callable[..., tuple[int, str]]:
    """Call the command line in a process of its own, for what leaves threads and helpers behind until its end.

    Further processes take part from the second part on, however soon all would be done without them.
    """
    program = tmp_path / "without_waiting.py"
    program.write_text(_WITHOUT_WAITING)

    def call(*arguments: object) -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, program, *map(str, arguments)],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
            env={**os.environ, "STATION_HOME": str(tmp_path / "home")},
        )
        return done.returncode, done.stdout + done.stderr

    return call


_CLUSTER = """
from distributed import LocalCluster
with LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, host="127.0.0.1",
                  protocol="tcp") as cluster:
    print(cluster.scheduler_address, flush=True)
    input()
"""


@pytest.fixture
def cluster() -> Iterator[str]:
    """A Dask scheduler with a worker, in a process of its own; its address."""
    with subprocess.Popen(
        [sys.executable, "-c", _CLUSTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.communicate("\n", timeout=60)
