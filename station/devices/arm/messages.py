"""Channel messages between the driver and the ur-rtde process."""

from typing import ClassVar

from station.channel.messages import ChannelMessage

Six = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]


class Watch(ChannelMessage):
    """Connect to receive the controller's state."""

    purpose: ClassVar[str] = "to receive the controller's state"


class Command(ChannelMessage):
    """Connect to command the arm, which uploads the control program."""

    purpose: ClassVar[str] = "to start the control program"
    tool_centre_mm: Position
    payload_kg: float
    payload_centre_mm: Position
    watchdog_hz: float


class Upload(ChannelMessage):
    """Send the control program again over the present connection and check that it plays."""

    purpose: ClassVar[str] = "to upload the control program again"


class Beat(ChannelMessage):
    """Read the state; the station is healthy for so long from now."""

    purpose: ClassVar[str] = "for the arm's state"
    healthy_for_s: float


class Beside(ChannelMessage):
    """Compute the joint positions of a tool pose with an offset and the same orientation."""

    purpose: ClassVar[str] = "for the way to a place beside"
    joints_rad: Six
    offset_mm: Position
    """Along the tool's own x, y and z."""


class Move(ChannelMessage):
    """Start a motion to joint positions, straight for the tool or straight for the joints."""

    purpose: ClassVar[str] = "to begin a motion"
    joints_rad: Six
    straight: bool
    speed: float
    """rad/s, or mm/s if straight."""
    acceleration: float
    """rad/s², or mm/s² if straight."""


class Reachable(ChannelMessage):
    """Check that joint positions are within the safety limits and have a solution."""

    purpose: ClassVar[str] = "whether the pose is reachable"
    joints_rad: Six


class Halt(ChannelMessage):
    """Brake to rest."""

    purpose: ClassVar[str] = "to brake"
    deceleration_rad_s2: float


class Outcome(ChannelMessage):
    """Success, or ur-rtde's output after a failure."""

    done: bool
    words: str = ""
    joints_rad: Six | None = None
    """Result of `Beside`."""


class Snapshot(ChannelMessage):
    """The controller's state."""

    age_s: float
    joints_rad: Six
    speeds_rad_s: Six
    tool_pose: Six
    """x, y, z in m and the rotation vector in rad."""
    robot_mode: int
    safety_bits: int
    runtime_state: int
    commanding: bool
    """Whether the commanding connection is up."""
    underway: bool
    """Whether the control program reports a motion."""
    kicks_late: bool = False
    """Whether the controller's watchdog was not kicked within its limit since the program began."""
