"""A gripper's wire that a test writes, status by status."""

from station.devices.gripper.link import Status
from station.messages import gripper as messages


class ScriptedLink:
    """Gives one status after another, the last one for ever."""

    place = messages.PLACE_URCAP(address="a script")

    def __init__(self, *statuses: Status) -> None:
        self._statuses = list(statuses)
        self.sent: list[str] = []

    async def status(self) -> Status:
        return self._statuses.pop(0) if len(self._statuses) > 1 else self._statuses[0]

    async def reset(self) -> None:
        self.sent.append("reset")

    async def begin_activation(self) -> None:
        self.sent.append("begin_activation")

    async def go_to(self, position: int, speed: int, force: int) -> None:
        self.sent.append(f"go_to {position}")

    async def halt(self) -> None:
        self.sent.append("halt")

    async def close(self) -> None:
        self.sent.append("close")
