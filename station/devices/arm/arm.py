"""What the station may ask of an arm."""

from dataclasses import dataclass
from typing import Protocol

from station.devices.arm.faults import ArmFault
from station.settings.arm import PoseName


@dataclass(frozen=True, slots=True)
class ArmState:
    """What is known of the arm now; what is not surely known is None."""

    age_s: float | None
    """How old the controller's state is; None where none has come."""
    joints_rad: tuple[float, ...] | None
    """Six joint positions; None where the state is stale."""
    tool_position_mm: tuple[float, float, float] | None
    """The tool centre point in the base's frame; None where the state is stale."""
    moving: bool | None
    """Whether the arm moves; None where the state is stale."""
    at: PoseName | None
    """The named pose where the arm stands, `nest` also beside it; None where it is elsewhere, moves, or the state is
    stale."""
    fault: ArmFault | None
    """Why nothing can be moved; None where the arm is ready."""

    @property
    def ready(self) -> bool:
        """Whether a motion may be asked for."""
        return self.fault is None


class Arm(Protocol):
    """An arm between named poses. Everything that cannot be done raises `ArmFault` with its cause and remedy."""

    async def state(self) -> ArmState:
        """What is known now; it never raises and never waits longer than the state is good for."""
        ...

    def renew_health(self, lease_s: float) -> None:
        """Say that the station is healthy for a while; when the lease runs out, the controller stops the arm.

        Args:
            lease_s: seconds from now.
        """
        ...

    async def move_to(self, pose: PoseName) -> None:
        """Go to a pose and return when it is reached; already being there is no motion. A cancelled move is stopped.

        Raises:
            ArmFault: the arm is not ready, cannot go there, or was kept from arriving.
        """
        ...

    async def move_beside_nest(self, offset_mm: tuple[float, float, float]) -> None:
        """Go straight to the nest moved by an offset, and return when it is reached. A cancelled move is stopped.

        Args:
            offset_mm: from the nest, along the tool's own x, y and z.

        Raises:
            ArmFault: the arm is not ready, may not go there, or was kept from arriving.
        """
        ...

    async def stop(self) -> None:
        """Brake to rest; an arm at rest stays so. This is no emergency stop.

        Raises:
            ArmFault: the controller does not confirm; its watchdog then stops the arm.
        """
        ...

    async def confirm_protective_stop(self) -> None:
        """A person has seen why the arm stopped: leave the protective stop and make the arm ready again.

        Raises:
            ArmFault: the controller refuses, or the arm does not become ready.
        """
        ...

    async def power_on_and_release_brakes(self) -> None:
        """A person has made sure that the arm may start: power, brakes, program. A running arm is left as it is.

        Raises:
            ArmFault: the controller refuses, or the arm does not become ready.
        """
        ...

    async def upload_again(self) -> None:
        """A person wants the program to run again after it was stopped; a running one is left as it is.

        Raises:
            ArmFault: the program does not play.
        """
        ...

    async def close(self) -> None:
        """Let the arm go; closing twice does nothing."""
        ...
