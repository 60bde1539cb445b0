"""The camera's check: how fast it gives frames."""

import asyncio
from itertools import accumulate, count
from types import SimpleNamespace

import numpy as np
import pytest

from station.devices.camera import probe
from station.devices.camera.interface import Frame
from station.settings.camera import CameraSettings

FRAME_S = 1 / 30


class Timed:
    """A camera of 30 frames/s whose frames come at these intervals."""

    description = SimpleNamespace(
        name="timed", width_px=640, height_px=480, revision="", notice=None, frames_per_s=30.0
    )

    def __init__(self, intervals_s: list[float]) -> None:
        self._times_s = accumulate(intervals_s)
        self._numbers = count()

    async def open(self) -> None:
        pass

    async def close(self) -> None:
        pass

    async def frame(self, newer_than_s: float, deadline_s: float) -> Frame:
        return Frame(np.zeros((2, 2, 3), np.uint8), next(self._numbers), next(self._times_s))


@pytest.mark.parametrize(
    ("intervals_s", "verdict"),
    [
        ([FRAME_S] * 15, "ok"),
        ([FRAME_S] * 7 + [0.5] + [FRAME_S] * 7, "ok"),
        ([1 / 20] * 15, "warning"),
        ([FRAME_S, FRAME_S, 2 * FRAME_S] * 5, "warning"),
    ],
    ids=["as it should be", "one pause of a busy machine", "20 frames/s", "every fourth frame lost"],
)
def test_a_camera_is_slow_whose_frames_come_late_more_than_once(monkeypatch, intervals_s, verdict):
    monkeypatch.setattr(probe, "camera_from", lambda _settings: Timed(intervals_s))
    [result] = asyncio.run(probe.probe_camera(CameraSettings()))
    assert result.verdict == verdict
