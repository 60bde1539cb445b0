"""The contact of the maintenance page's live image: measured with the unit's threshold, as an inspection has it."""

import asyncio
import time
from types import SimpleNamespace
from typing import Any

import cv2
import pytest

from station.channel.panel_maintenance import GetLiveImage
from station.devices.camera.interface import Frame
from station.inspection.states import State
from station.runtime.imaging.golden_reference import GOLDEN
from station.runtime.rpc.maintenance import PanelMaintenance
from station.settings.segmentation import Segmentation
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import draw_fruit
from station.twin.gel import Gel
from station.twin.squeeze import Squeeze

WEAK_MM = 0.1
"""Closing at which a blueberry's contact is found by the recipe's threshold, and not by one half as high again."""


class Worker:
    async def do(self, work):
        return work()


@pytest.mark.parametrize(("factor", "found"), [(1.0, True), (1.5, False)])
def test_a_weak_contact_is_shown_only_where_an_inspection_of_this_unit_would_find_it(tmp_path, factor, found):
    sensor, fruit, gel = DigitSensor(1), draw_fruit("blueberry", 1), Gel()
    cv2.imwrite(str(tmp_path / GOLDEN), sensor.frame(None, 0.0))
    touched = sensor.frame(FruitOnGel(fruit, Pose(), gel).pressed(Squeeze(fruit, gel).at(WEAK_MM)).dent, 0.1)

    async def frame(*_):
        return Frame(touched, 1, time.monotonic())

    calibration = SimpleNamespace(gate_factor=factor, golden=lambda: None, in_force=SimpleNamespace(mm_per_px=0.05))
    devices = SimpleNamespace(calibration=calibration, cell=SimpleNamespace(camera=SimpleNamespace(frame=frame)))
    active = SimpleNamespace(recipe=SimpleNamespace(segmentation=Segmentation()))
    production: Any = SimpleNamespace(
        service=SimpleNamespace(state=State.IDLE, active=active), devices=devices,
        interlock=None, plc_commands=None, line_state=None,
    )  # fmt: skip
    observability: Any = SimpleNamespace(audit=None, versions={})
    worker: Any = Worker()
    log: Any = None
    page = PanelMaintenance(production, observability, tmp_path, worker, log)
    image = asyncio.run(page.live_image(GetLiveImage(contact=True)))
    assert image.contact is None
    assert image.area_px is not None
    assert (image.area_px > 0) is found
