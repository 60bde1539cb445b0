"""An activation that is stopped before the fingers travel."""

import asyncio

import pytest

from station.devices.gripper.errors import GripperStoppedError
from station.devices.gripper.link import State, Status
from station.devices.gripper.robotiq import Robotiq2F85
from station.messages import gripper as messages
from station.settings.gripper import GripperSettings


class ResetLink:
    """A gripper without its activation, which never becomes active."""

    place = messages.PLACE_URCAP(address="a script")

    def __init__(self) -> None:
        self.sent: list[str] = []
        self.was_reset = asyncio.Event()

    async def status(self) -> Status:
        return Status(state=State.RESET, go_to=False, object_=0, fault=0, echo=0, position=3, current_a=None)

    async def reset(self) -> None:
        self.sent.append("reset")
        self.was_reset.set()

    async def begin_activation(self) -> None:
        self.sent.append("begin_activation")

    async def go_to(self, position: int, speed: int, force: int) -> None:
        self.sent.append(f"go_to {position}")

    async def halt(self) -> None:
        self.sent.append("halt")

    async def close(self) -> None:
        self.sent.append("close")


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
