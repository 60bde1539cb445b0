"""Arm settings: poses, speeds, tool and deadlines."""

from math import pi
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from station.messages import settings as messages
from station.settings.model import Settings, setting
from station.settings.problems import FieldError

PoseName = Literal["home", "above_nest", "nest", "accept", "reject"]
"""The places that the arm goes to."""

BRAKING_SHARE = 0.8
"""The share of the watchdog's period that braking may take."""

Angle = Annotated[float, Field(ge=-2 * pi, le=2 * pi)]
JointVector = Annotated[tuple[Angle, Angle, Angle, Angle, Angle, Angle], Field(strict=False)]
"""Base, shoulder, elbow, wrist 1, 2 and 3 in rad, each within one turn either way."""

Millimetres = Annotated[float, Field(ge=-2000.0, le=2000.0)]
Position = Annotated[tuple[Millimetres, Millimetres, Millimetres], Field(strict=False)]

TAUGHT = "Joint positions base, shoulder, elbow, wrist 1, 2, 3; the default suits the twin, a site teaches its own."


class ArmPoses(Settings):
    """The named places, as joint positions."""

    home: JointVector = setting(
        (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0), title="Home", description=TAUGHT, unit="rad"
    )
    above_nest: JointVector = setting(
        (-0.0323, -1.4616, 1.6788, -1.7881, -1.5708, -0.0323), title="Above the nest", description=TAUGHT, unit="rad"
    )
    nest: JointVector = setting(
        (-0.0323, -1.4118, 1.8052, -1.9642, -1.5708, -0.0323),
        title="Nest",
        description=f"{TAUGHT} The tool goes straight to it and straight away from it.",
        unit="rad",
    )
    accept: JointVector = setting(
        (0.6132, -1.3811, 1.5852, -1.7749, -1.5708, 0.6132), title="Accept", description=TAUGHT, unit="rad"
    )
    reject: JointVector = setting(
        (-0.9743, -1.4971, 1.718, -1.7916, -1.5708, -0.9743), title="Reject", description=TAUGHT, unit="rad"
    )

    def joints_rad(self, name: PoseName) -> tuple[float, float, float, float, float, float]:
        """A place's joint positions, rad."""
        return getattr(self, name)


ToolAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
"""One of the tool's axes, forwards or backwards."""


class Centring(Settings):
    """Centring: motion of the arm to a contact that is off the field's middle."""

    most_mm: float = setting(
        3.0,
        title="Farthest",
        description="So far from the taught nest the arm may follow a contact; there must be as much room all around "
        "the fingers. A contact farther off is pressed where it is.",
        unit="mm",
        ge=0.0,
        le=10.0,
    )
    image_right: ToolAxis = setting(
        "+x",
        title="Image's right",
        description="The tool's axis that points to the right in the sensor's image: moved along it, the sensor shows "
        "a contact farther to the left. The default suits the twin.",
    )
    image_down: ToolAxis = setting(
        "+z",
        title="Image's bottom",
        description="The tool's axis that points down in the sensor's image. The default suits the twin.",
    )

    @model_validator(mode="after")
    def _two_axes(self) -> Self:
        if self.image_right[1] == self.image_down[1]:
            raise FieldError([((), messages.ONE_AXIS(axis=self.image_right[1]))])
        return self

    def in_tool_mm(self, right_mm: float, down_mm: float) -> tuple[float, float, float]:
        """Convert a distance right and down in the image to the tool's x, y and z, mm."""
        way = dict.fromkeys("xyz", 0.0)
        for (sign, axis), distance_mm in ((self.image_right, right_mm), (self.image_down, down_mm)):
            way[axis] = -distance_mm if sign == "-" else distance_mm
        return way["x"], way["y"], way["z"]


class ArmSettings(Settings):
    """Settings of the UR10e and its driver."""

    host: str = setting(
        "127.0.0.2",
        title="Address",
        description="The controller's address or name. The default is the twin; ur-rtde does not check for remote "
        "control at localhost, 127.0.0.1 and 192.168.56.101.",
        min_length=1,
        max_length=253,
        pattern=r"^[A-Za-z0-9.:-]+$",
    )
    frequency_hz: float = setting(
        500.0,
        title="RTDE frequency",
        description="How often the controller sends its state; 500 is an e-Series controller's own cycle.",
        unit="Hz",
        ge=20.0,
        le=500.0,
    )
    poses: ArmPoses = setting(ArmPoses(), title="Poses", description="The named places that the arm goes to.")
    waits_at: Literal["home", "above_nest"] = setting(
        "above_nest",
        title="Waits at",
        description="Where the arm waits between two fruit. Above the nest it is there at once; at home it leaves the "
        "room above the nest to the line, and each fruit takes the way from there and back longer.",
    )
    jaw_clearance_mm: float = setting(
        3.0,
        title="Jaws' clearance",
        description="When the arm brings the jaws to a fruit they stand so much wider than the widest fruit that the "
        "recipe expects: room for one beside the nest's middle. A starting value without a source.",
        unit="mm",
        ge=0.0,
        le=30.0,
    )
    centring: Centring = setting(
        Centring(), title="Centring", description="How the arm follows a contact that is off the field's middle."
    )
    joint_speed_rad_s: float = setting(
        1.0,
        title="Joint speed",
        description="Speed of the leading joint between poses; ur-rtde allows at most 3.14. 1 is half of what the "
        "UR10e's slowest joints can do, 120° a second.",
        unit="rad/s",
        gt=0.0,
        le=3.14,
    )
    joint_acceleration_rad_s2: float = setting(
        2.0,
        title="Joint acceleration",
        description="Acceleration of the leading joint between poses; ur-rtde allows at most 40. 2 is at full speed "
        "after half a second: a starting value, unverified on hardware.",
        unit="rad/s²",
        gt=0.0,
        le=40.0,
    )
    tool_speed_mm_s: float = setting(
        250.0,
        title="Tool speed",
        description="Speed of the straight way to and from the nest; ur-rtde allows at most 3000. 250 is the limit of "
        "ISO 10218-1 for reduced speed.",
        unit="mm/s",
        gt=0.0,
        le=3000.0,
    )
    tool_acceleration_mm_s2: float = setting(
        2500.0,
        title="Tool acceleration",
        description="Acceleration of the straight way to and from the nest; ur-rtde allows at most 150000. 2500 is a "
        "quarter of gravity: the arm is at full speed after 13 mm. Unverified on hardware.",
        unit="mm/s²",
        gt=0.0,
        le=150_000.0,
    )
    stop_deceleration_rad_s2: float = setting(
        4.0,
        title="Stop deceleration",
        description="How hard the leading joint brakes when the station stops a motion. It has to be at rest well "
        "before the watchdog's period is over, because the controller hears nothing else while it brakes.",
        unit="rad/s²",
        gt=0.0,
        le=40.0,
    )
    tool_centre_mm: Position = setting(
        (0.0, 0.0, 200.0),
        title="Tool centre point",
        description="Where the fingers' middle is, seen from the flange; gripper and sensor make about 200 along z.",
        unit="mm",
    )
    payload_kg: float = setting(
        1.3,
        title="Payload",
        description="Mass at the flange: gripper 0.9 kg and about 0.4 kg of adapter, sensor and cables.",
        unit="kg",
        ge=0.0,
        le=12.5,
    )
    payload_centre_mm: Position = setting(
        (0.0, 0.0, 70.0), title="Payload's centre", description="Centre of mass, seen from the flange.", unit="mm"
    )
    reached_tolerance_rad: float = setting(
        0.002,
        title="Reached within",
        description="A pose is reached when every joint is this near; 2 mrad at the arm's full reach are 2.6 mm.",
        unit="rad",
        gt=0.0,
        le=0.1,
    )
    stale_after_s: float = setting(
        0.1,
        title="Stale after",
        description="An older state is not used: the position counts as unknown and nothing is moved.",
        unit="s",
        ge=0.02,
        le=1.0,
    )
    link_lost_after_s: float = setting(
        0.5,
        title="Link lost after",
        description="After so long without a new state the driver's process is killed and started anew.",
        unit="s",
        ge=0.1,
        le=10.0,
    )
    constructor_limit_s: float = setting(
        8.0,
        title="Connecting limit",
        description="A connection that is not made by then is taken for hung, and the driver's process is killed. "
        "ur-rtde itself waits up to 5 s for the controller's program.",
        unit="s",
        ge=0.5,
        le=60.0,
    )
    call_deadline_s: float = setting(
        4.0,
        title="Call deadline",
        description="How long the controller may take to accept one command; ur-rtde itself waits 3 s for it.",
        unit="s",
        ge=0.5,
        le=30.0,
    )
    move_deadline_s: float = setting(
        20.0,
        title="Move deadline",
        description="A motion that has not arrived by then is stopped and reported.",
        unit="s",
        ge=0.5,
        le=300.0,
    )
    recovery_deadline_s: float = setting(
        60.0,
        title="Recovery deadline",
        description="How long a recovery that a person asked for may take; a controller refuses to leave a protective "
        "stop in its first 5 s, and powering on and releasing the brakes may take half a minute.",
        unit="s",
        ge=1.0,
        le=300.0,
    )
    watchdog_hz: float = setting(
        2.0,
        title="Watchdog",
        description="The controller stops its program when it hears less often than this from a healthy station.",
        unit="Hz",
        ge=0.5,
        le=50.0,
    )

    @model_validator(mode="after")
    def _stops_before_the_watchdog(self) -> Self:
        braking_s = self.joint_speed_rad_s / self.stop_deceleration_rad_s2
        allowed_s = BRAKING_SHARE / self.watchdog_hz
        if braking_s > allowed_s:
            expected = messages.BRAKES_TOO_LONG(
                speed=self.joint_speed_rad_s,
                deceleration=self.stop_deceleration_rad_s2,
                braking_s=braking_s,
                watchdog_hz=self.watchdog_hz,
                allowed_s=allowed_s,
            )
            raise FieldError([((), expected)])
        return self
