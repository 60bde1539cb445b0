"""The contact of the maintenance page's live image: measured as an inspection of the same unit measures it."""

import asyncio
import time
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np

from station.calibration.gate import gated
from station.channel.panel_maintenance import GetLiveImage
from station.devices.camera.interface import Frame
from station.inspection.states import State
from station.runtime.imaging.golden_reference import GOLDEN
from station.runtime.rpc import maintenance
from station.runtime.rpc.maintenance import PanelMaintenance
from station.settings.segmentation import Segmentation

FACTOR = 1.5
IMAGE = np.full((64, 48, 3), 120, np.uint8)


class Worker:
    async def do(self, work):
        return work()


def test_the_live_images_contact_is_measured_with_the_units_gate(tmp_path, monkeypatch):
    cv2.imwrite(str(tmp_path / GOLDEN), IMAGE)
    segmentation, made = Segmentation(), list[Segmentation]()

    def make(_, given):
        made.append(given)
        mask = np.zeros(IMAGE.shape[:2], np.uint8)
        return SimpleNamespace(measure=lambda _: SimpleNamespace(mask=mask, area_px=0, flags=frozenset()))

    async def frame(*_):
        return Frame(IMAGE, 1, time.monotonic())

    monkeypatch.setattr(maintenance, "make_method", make)
    calibration = SimpleNamespace(gate_factor=FACTOR, golden=lambda: None, in_force=SimpleNamespace(mm_per_px=0.05))
    devices = SimpleNamespace(calibration=calibration, cell=SimpleNamespace(camera=SimpleNamespace(frame=frame)))
    active = SimpleNamespace(recipe=SimpleNamespace(segmentation=segmentation))
    production: Any = SimpleNamespace(
        service=SimpleNamespace(state=State.IDLE, active=active), devices=devices,
        interlock=None, plc_commands=None, line_state=None,
    )  # fmt: skip
    observability: Any = SimpleNamespace(audit=None, versions={})
    worker: Any = Worker()
    log: Any = None
    page = PanelMaintenance(production, observability, tmp_path, worker, log)
    image = asyncio.run(page.live_image(GetLiveImage(contact=True)))
    assert (image.area_px, image.contact) == (0, None)
    assert made == [gated(segmentation, FACTOR)]
    assert made != [segmentation]
