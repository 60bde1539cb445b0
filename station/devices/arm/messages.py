"""What the driver and its process say to each other."""

from typing import ClassVar

from station.channel.messages import Message

Six = tuple[float, float, float, float, float, float]
Position = tuple[float, float, float]


class Watch(Message):
    """Connect to receive the controller's state."""

    purpose: ClassVar[str] = "to receive the controller's state"


class Command(Message):
    """Connect to command the arm, which uploads the control program."""

    purpose: ClassVar[str] = "to start the control program"
    tool_centre_mm: Position
    payload_kg: float
    payload_centre_mm: Position
    watchdog_hz: float


class Upload(Message):
    """Send the control program again over the standing connection and see that it plays."""

    purpose: ClassVar[str] = "to upload the control program again"


class Beat(Message):
    """Tell the state; the station is healthy for so long from now."""

    purpose: ClassVar[str] = "for the arm's state"
    healthy_for_s: float


class Beside(Message):
    """Ask for the joint positions that bring the tool beside other joint positions' place, not turned."""

    purpose: ClassVar[str] = "for the way to a place beside"
    joints_rad: Six
    offset_mm: Position
    """Along the tool's own x, y and z."""


class Move(Message):
    """Begin a motion to joint positions, straight for the tool or straight for the joints."""

    purpose: ClassVar[str] = "to begin a motion"
    joints_rad: Six
    straight: bool
    speed: float
    """rad/s, or mm/s where straight."""
    acceleration: float
    """rad/s², or mm/s² where straight."""


class Reachable(Message):
    """Ask whether joint positions are within the safety limits and have a solution."""

    purpose: ClassVar[str] = "whether the pose is reachable"
    joints_rad: Six


class Halt(Message):
    """Brake to rest."""

    purpose: ClassVar[str] = "to brake"
    deceleration_rad_s2: float


class Outcome(Message):
    """Whether it was done; where not, what ur-rtde said."""

    done: bool
    words: str = ""
    joints_rad: Six | None = None
    """What was asked for, of `Beside`."""


class Snapshot(Message):
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
    """Whether the connection that commands stands."""
    underway: bool
    """Whether the control program reports a motion."""
    kicks_late: bool = False
    """Whether the controller's watchdog was left without a kick for longer than its limit since the program began."""
