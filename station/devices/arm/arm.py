"""Arm interface of the station."""

from dataclasses import dataclass
from typing import Protocol

from station.devices.arm.faults import ArmFault
from station.settings.arm import PoseName


@dataclass(frozen=True, slots=True)
class ArmState:
    """State of the arm; uncertain values are None."""

    age_s: float | None
    """Age of the controller's state; None if there is none yet."""
    joints_rad: tuple[float, ...] | None
    """Six joint positions; None if the state is stale."""
    moving: bool | None
    """Whether the arm moves; None if the state is stale."""
    at: PoseName | None
    """The arm's named pose, `nest` also with an offset; None if it is elsewhere, moves, or the state is stale."""
    fault: ArmFault | None
    """Fault that prevents motion; None if the arm is ready."""


class Arm(Protocol):
    """Arm that moves between named poses. A failure raises `ArmFault` with its cause and remedy."""

    async def state(self) -> ArmState:
        """Return the state now; never raises and never waits longer than a state is valid."""
        ...

    def renew_health(self, lease_s: float) -> None:
        """Renew the health lease, in seconds from now; when it runs out, the controller stops the arm."""
        ...

    async def move_to(self, pose: PoseName) -> None:
        """Move to a pose and return when it is reached; no motion if it is there already. A cancelled move is stopped.

        Raises:
            ArmFault: the arm is not ready, cannot move there, or was stopped on the way.
        """
        ...

    async def move_beside_nest(self, offset_mm: tuple[float, float, float]) -> None:
        """Move straight to the nest plus an offset along the tool's own x, y and z, as `move_to`.

        Raises:
            ArmFault: the arm is not ready, may not move there, or was stopped on the way.
        """
        ...

    async def stop(self) -> None:
        """Brake to rest; an arm at rest does not change. This is no emergency stop.

        Raises:
            ArmFault: the controller does not confirm; its watchdog then stops the arm.
        """
        ...

    async def confirm_protective_stop(self) -> None:
        """Leave the protective stop, after a person has checked its cause, and make the arm ready again.

        Raises:
            ArmFault: the controller refuses, or the arm does not become ready.
        """
        ...

    async def power_on_and_release_brakes(self) -> None:
        """Power on, release the brakes, start the program, after a person's check. A running arm does not change.

        Raises:
            ArmFault: the controller refuses, or the arm does not become ready.
        """
        ...

    async def upload_again(self) -> None:
        """Restart the program for a person after it was stopped; a running one does not change.

        Raises:
            ArmFault: the program does not play.
        """
        ...

    async def close(self) -> None:
        """Close the connection. Idempotent."""
        ...
