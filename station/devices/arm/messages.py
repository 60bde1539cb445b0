"""Channel messages between the driver and the ur-rtde process."""

from typing import ClassVar

from station.channel.messages import ChannelMessage
from station.messages import arm as messages
from station.messages.message import Message

Six = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]


class ArmRequest(ChannelMessage):
    """A request to the ur-rtde process."""

    meaning: ClassVar[Message]
    """The request as a person reads it in a fault."""


class Start(ArmRequest):
    """Answer once the process has started."""

    meaning: ClassVar[Message] = messages.REQUEST_START()


class Watch(ArmRequest):
    """Connect to receive the controller's state."""

    meaning: ClassVar[Message] = messages.REQUEST_WATCH()


class Command(ArmRequest):
    """Connect to command the arm, which uploads the control program."""

    meaning: ClassVar[Message] = messages.REQUEST_COMMAND()
    tool_centre_mm: Position
    payload_kg: float
    payload_centre_mm: Position
    watchdog_hz: float


class Upload(ArmRequest):
    """Send the control program again over the present connection and check that it plays."""

    meaning: ClassVar[Message] = messages.REQUEST_UPLOAD()


class Beat(ArmRequest):
    """Read the state; the station is healthy for so long from now."""

    meaning: ClassVar[Message] = messages.REQUEST_BEAT()
    healthy_for_s: float


class Beside(ArmRequest):
    """Compute the joint positions of a tool pose with an offset and the same orientation."""

    meaning: ClassVar[Message] = messages.REQUEST_BESIDE()
    joints_rad: Six
    offset_mm: Position
    """Along the tool's own x, y and z."""


class Move(ArmRequest):
    """Start a motion to joint positions, straight for the tool or straight for the joints."""

    meaning: ClassVar[Message] = messages.REQUEST_MOVE()
    joints_rad: Six
    straight: bool
    speed: float
    """rad/s, or mm/s if straight."""
    acceleration: float
    """rad/s², or mm/s² if straight."""


class Reachable(ArmRequest):
    """Check that joint positions are within the safety limits and have a solution."""

    meaning: ClassVar[Message] = messages.REQUEST_REACHABLE()
    joints_rad: Six


class Halt(ArmRequest):
    """Brake to rest."""

    meaning: ClassVar[Message] = messages.REQUEST_HALT()
    deceleration_rad_s2: float


class Outcome(ChannelMessage):
    """Success, or the output after a failure."""

    done: bool
    output: Message | None = None
    """Of ur-rtde, or why the process did not call it; None if there is none."""
    joints_rad: Six | None = None
    """Result of `Beside`."""


class Snapshot(ChannelMessage):
    """The controller's state."""

    age_s: float
    joints_rad: Six
    speeds_rad_s: Six
    robot_mode: int
    safety_bits: int
    runtime_state: int
    commanding: bool
    """Whether the commanding connection is up."""
    underway: bool
    """Whether the control program reports a motion."""
    connected: bool = True
    """Whether the controller has not closed the receiving connection."""
    kicks_late: bool = False
    """Whether the controller's watchdog was not kicked within its limit since the program began."""
