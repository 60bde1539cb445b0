"""Records in a folder of the test's own, and what goes into them."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from station.cli import cli
from station.messages.judge import AREA_OVER, LIMIT, STOPPED_KEPT
from station.records.model import CurvePoint, Image, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.settings.recipe import find_recipe
from station.settings.records import RecordsSettings

SCENARIO_LIMIT_S = 60.0

Open = Callable[..., AbstractAsyncContextManager[Records]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "records"


@pytest.fixture
def opened(folder: Path) -> Open:
    """Open records, close them at the end; one call is one start of a station."""
    starts = 0

    @asynccontextmanager
    async def open_them(where: Path = folder, **settings: Any) -> AsyncIterator[Records]:
        nonlocal starts
        starts += 1
        chosen = RecordsSettings(**dict[str, Any]({"deadline_s": 20.0, "free_reserve_mb": 1, **settings}))
        records = await Records.open(where, chosen, f"boot-{starts}")
        try:
            yield records
        finally:
            await records.close()

    return open_them


@pytest.fixture
def run_records(folder: Path) -> Callable[..., Result]:
    """Run `station records …` on this folder."""

    def run(*arguments: object) -> Result:
        return CliRunner(env={"STATION_HOME": str(folder.parent)}).invoke(cli, ["records", *map(str, arguments)])

    return run


@pytest.fixture
def scenario() -> Callable[[Callable[[], Awaitable[Any]]], Any]:
    """Run an asynchronous scenario within a generous limit."""

    def run(steps: Callable[[], Awaitable[Any]]) -> Any:
        async def limited() -> Any:
            async with asyncio.timeout(SCENARIO_LIMIT_S):
                return await steps()

        return asyncio.run(limited())

    return run


@pytest.fixture
def trigger() -> Trigger:
    recipe = RecipeSnapshot.of(find_recipe("strawberry").model_dump(mode="json"))
    return Trigger(
        trigger_id=7, encoder=1234, lot="A-17", began_utc_ms=1_700_000_000_000, recipe=recipe, simulated=True
    )


@pytest.fixture
def passed() -> InspectionRecord:
    return InspectionRecord(
        outcome="PASS",
        reasons=(),
        explanation=(STOPPED_KEPT(closing_mm=4.0),),
        late=False,
        partial=False,
        area_mm2=31.5,
        area_px=44_500,
        closing_mm=4.02,
        confidence=0.93,
        ended_utc_ms=1_700_000_003_210,
        duration_ms=3210,
        curve=tuple(CurvePoint(step, 30.0 - step, float(step), 8.0 * step, 11_000 * step, 0.9) for step in range(5)),
        phases_s={"approach": 0.8, "steps": 2.1},
        measures={"growth_mm2_per_mm": 8.0, "onset_mm": 25.5},
        devices={"camera": "DIGIT D20966"},
        versions={"fruit-station": "0.1.0"},
    )


@pytest.fixture
def failed(passed: InspectionRecord) -> InspectionRecord:
    return replace(
        passed,
        outcome="FAIL",
        reasons=("area_over_limit", "early_stop"),
        explanation=(AREA_OVER(closing_mm=4.0, area_mm2=170.0, limit=LIMIT(limit_mm2=165.0)),),
        area_mm2=170.0,
        partial=True,
    )


@pytest.fixture
def noise() -> Callable[..., Image]:
    """An image that no compression makes small, another one each time."""
    random = np.random.default_rng(5)

    def make(kind: Any = "step", step: int | None = 0, side_px: int = 64) -> Image:
        return Image(kind, step, random.integers(0, 256, (side_px, side_px, 3), dtype=np.uint8))

    return make


@pytest.fixture
def settled() -> Callable[[Records], Awaitable[None]]:
    """Wait until all images are written or given up."""

    async def wait(records: Records) -> None:
        while records.status().images_waiting:
            await asyncio.sleep(0.005)

    return wait
