"""Metrics, health and the requests to them."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from station.channel.line import Outcome
from station.runtime.observability.metrics import Metrics


@pytest.fixture
def scenario() -> Callable[[Callable[[], Awaitable[Any]]], Any]:
    """Run an asynchronous scenario within a generous limit."""

    def run(steps: Callable[[], Awaitable[Any]]) -> Any:
        async def limited() -> Any:
            async with asyncio.timeout(60):
                return await steps()

        return asyncio.run(limited())

    return run


class Clock:
    """A monotonic clock that the test moves."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def metrics(clock: Clock) -> Metrics:
    return Metrics("0.1.0", deadline_s=8.0, clock=clock)


@pytest.fixture
def outcome() -> Outcome:
    return Outcome(
        sequence=4711,
        trigger_id=12,
        outcome="PASS",
        reasons=(),
        late=False,
        partial=False,
        simulated=True,
        area_mm2=31.5,
        area_px=44_500,
        closing_mm=4.02,
        confidence=0.9,
        recipe_number=1,
        recipe_checksum=5,
        began_utc_ms=1,
        ended_utc_ms=2,
        duration_ms=3210,
        encoder=0,
        lot="A-17",
    )
