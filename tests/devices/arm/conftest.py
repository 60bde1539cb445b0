"""A controller and a driver for each test, on an address of their own."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from typing import Any

import pytest

from station.devices.arm.ur import UrArm
from station.settings.arm import ArmSettings
from station.twin.clock import SteadyClock
from station.twin.faults import FaultBoard
from station.twin.ur.controller import UrController, arm_faults
from tests import eventually
from tests.hosts import fresh_host


class SkippingClock:
    """The steady clock, and a test may jump ahead."""

    def __init__(self) -> None:
        self._steady = SteadyClock()
        self._skipped_s = 0.0

    def now_s(self) -> float:
        return self._steady.now_s() + self._skipped_s

    def skip(self, duration_s: float) -> None:
        self._skipped_s += duration_s


class Bench:
    """A controller, its faults and clock, and the driver's settings for it."""

    def __init__(self, host: str, **controller: Any) -> None:
        self.clock = SkippingClock()
        self.faults: FaultBoard = arm_faults()
        self.controller = UrController(host, self.clock, self.faults, **controller)
        self.host = host

    def forgive_no_silence(self) -> None:
        """Have the watchdog expire also where the controller pauses itself, as it does on a busy machine."""

        def forgive_nothing(now_s: float) -> None:
            pass

        self.controller.script.stood_still = forgive_nothing

    def settings(self, **changes: object) -> ArmSettings:
        base: dict[str, object] = {
            "host": self.host,
            "joint_speed_rad_s": 2.0,
            "joint_acceleration_rad_s2": 8.0,
            "watchdog_hz": 0.5,
            "stale_after_s": 1.0,
            "link_lost_after_s": 2.0,
        }
        return ArmSettings.model_validate(base | changes)


@pytest.fixture
def host() -> str:
    return fresh_host()


@pytest.fixture
def bench() -> Callable[..., contextlib.AbstractAsyncContextManager[Bench]]:
    @contextlib.asynccontextmanager
    async def running(**controller: Any) -> AsyncIterator[Bench]:
        made = Bench(fresh_host(), **controller)
        await made.controller.start()
        try:
            yield made
        finally:
            await made.controller.stop()

    return running


@pytest.fixture
def healthy_arm(bench) -> Callable[..., contextlib.AbstractAsyncContextManager[tuple[Bench, UrArm]]]:
    """A ready arm whose station stays healthy."""

    @contextlib.asynccontextmanager
    async def running(**changes: object) -> AsyncIterator[tuple[Bench, UrArm]]:
        async with bench() as made, UrArm(made.settings(**changes)) as arm, stay_healthy(arm):
            await arm.ready(20.0)
            yield made, arm

    return running


@contextlib.asynccontextmanager
async def stay_healthy(arm: UrArm) -> AsyncIterator[None]:
    async def renew() -> None:
        while True:
            arm.renew_health(5.0)
            await asyncio.sleep(0.2)

    task = asyncio.create_task(renew())
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


@pytest.fixture
def healthy() -> Callable[[UrArm], contextlib.AbstractAsyncContextManager[None]]:
    return stay_healthy


@pytest.fixture
def until() -> Callable[..., Awaitable[Any]]:
    """Poll with little patience."""
    return lambda condition, patience_s=15.0: eventually.until(condition, patience_s)
