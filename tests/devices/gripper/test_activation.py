"""An activation that is stopped before the fingers travel."""

import asyncio

import pytest

from station.devices.gripper.errors import GripperStoppedError
from station.devices.gripper.link import State, Status
from station.devices.gripper.robotiq import Robotiq2F85
from station.settings.gripper import GripperSettings
from tests.devices.gripper.scripted_link import ScriptedLink


class ResetLink(ScriptedLink):
    """A gripper without its activation, which never becomes active."""

    def __init__(self) -> None:
        super().__init__(Status(state=State.RESET, go_to=False, object_=0, fault=0, echo=0, position=3, current_a=None))
        self.was_reset = asyncio.Event()

    async def reset(self) -> None:
        await super().reset()
        self.was_reset.set()


def test_a_stop_between_the_reset_and_the_activation_leaves_the_fingers_where_they_are():
    async def scenario():
        link = ResetLink()
        gripper = Robotiq2F85(link, GripperSettings(activation_timeout_s=1.0))
        activating = asyncio.create_task(gripper.activate())
        await link.was_reset.wait()
        await gripper.stop()
        with pytest.raises(GripperStoppedError):
            await activating
        assert link.sent == ["reset", "halt"]

    asyncio.run(scenario())
