"""Speed and force with which the jaws close, on the wire: a hand may be between them when a person jogs them."""

import asyncio
import contextlib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.panel_maintenance import JogGripper
from station.devices.gripper.calibration import force_setting, speed_setting
from station.devices.gripper.link import State, Status
from station.devices.gripper.robotiq import Robotiq2F85
from station.runtime.devices.manager import GRIPPER
from station.runtime.devices.rig import Cell, DeviceRig
from station.runtime.rpc.maintenance import PanelMaintenance
from station.settings.gripper import GripperSettings
from station.settings.recipe import find_recipe
from tests.devices.gripper.scripted_link import ScriptedLink
from tests.runtime.ball import MAX

WIDTH_MM = 30.0


class NotingLink(ScriptedLink):
    """Fingers that are at once where they are sent; notes with what speed and force they were."""

    def __init__(self) -> None:
        self.at = Status(state=State.ACTIVE, go_to=True, object_=3, fault=0, echo=50, position=50, current_a=None)
        super().__init__(self.at)
        self.settings: set[tuple[int, int]] = set()

    async def status(self) -> Status:
        return self.at

    async def go_to(self, position: int, speed: int, force: int) -> None:
        self.settings.add((speed, force))
        self.at = replace(self.at, echo=position, position=position)


@pytest.fixture
def link() -> NotingLink:
    return NotingLink()


@pytest.fixture
def gripper(link: NotingLink) -> Robotiq2F85:
    return Robotiq2F85(link, GripperSettings())


def test_a_press_closes_with_the_recipes_speed_and_force(link, gripper):
    recipe = find_recipe("strawberry")
    pressing = recipe.model_copy(
        update={"gripper": recipe.gripper.model_copy(update={"speed_mm_s": 23.0, "force_n": 37.0})}
    )
    unused: Any = None
    reached = asyncio.run(DeviceRig(Cell(unused, gripper, None), pressing).close_to(WIDTH_MM))
    assert reached.width_mm == pytest.approx(WIDTH_MM, abs=0.5)
    assert link.settings == {(speed_setting(23.0), force_setting(37.0))}


@pytest.mark.parametrize(("to", "width_mm"), [("width", WIDTH_MM), ("open", None)])
def test_a_jog_is_the_slowest_and_weakest_that_the_gripper_can(link, gripper, to, width_mm):
    panel = PanelMaintenance.__new__(PanelMaintenance)
    panel._moving = asyncio.Lock()
    service: Any = SimpleNamespace(manual=lambda *_: contextlib.nullcontext())
    monitor = SimpleNamespace(report_success=lambda: None)
    devices: Any = SimpleNamespace(cell=SimpleNamespace(gripper=gripper), monitors={GRIPPER: monitor}, halt=None)
    audit: Any = SimpleNamespace(log=lambda _: None)
    panel._service, panel._devices, panel._audit = service, devices, audit
    panel.refusal = lambda: None
    asyncio.run(panel.jog(JogGripper(to=to, width_mm=width_mm, actor=MAX)))
    assert link.settings == {(speed_setting(20.0), force_setting(20.0))} == {(0, 0)}
