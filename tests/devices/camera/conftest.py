"""A running twin of the sensor, and the driver on its wire."""

from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import NamedTuple

import cv2
import pytest

from station.devices.camera.twin import TwinCamera
from station.settings.camera import CameraSettings, TwinCameraSettings
from station.twin.clock import SteadyClock
from station.twin.digit.sensor import DigitSensor
from station.twin.digit.server import DigitCameraServer, digit_faults
from station.twin.fruit import draw_fruit
from station.twin.world import DIGIT_MM, World


class Bench(NamedTuple):
    """A running twin with a driver on its wire."""

    world: World
    server: DigitCameraServer
    camera: TwinCamera

    def close_to(self, closing_mm: float) -> None:
        """Move the fingers so that the fruit in the nest is closed by this much."""
        assert self.world.fruit is not None
        self.world.force_N(DIGIT_MM + self.world.fruit.width_mm - closing_mm)


def camera_settings(port: int, open_deadline_s: float = 5.0) -> CameraSettings:
    return CameraSettings(
        driver="twin", open_deadline_s=open_deadline_s, oldest_s=0.5, twin=TwinCameraSettings(port=port)
    )


@asynccontextmanager
async def _bench() -> AsyncIterator[Bench]:
    cv2.setNumThreads(1)
    clock = SteadyClock()
    world = World(clock)
    world.place(draw_fruit("blueberry", 1))
    server = DigitCameraServer(world, DigitSensor(1), clock, digit_faults())
    await server.start()
    camera = TwinCamera(camera_settings(server.port))
    try:
        yield Bench(world, server, camera)
    finally:
        await camera.close()
        await server.stop()


@pytest.fixture
def bench() -> Callable[[], AbstractAsyncContextManager[Bench]]:
    """Gives a running twin and a closed driver, for `async with bench() as …`."""
    return _bench


@pytest.fixture
def twin_settings() -> Callable[..., CameraSettings]:
    """Gives settings of the driver `twin` for a port."""
    return camera_settings
