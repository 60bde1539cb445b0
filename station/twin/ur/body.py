"""The arm itself: joints that move in real time along a path."""

import math
from collections.abc import Callable, Sequence

from station.twin.ur.kinematics import JOINT_RANGE_RAD, Joints, forward, inverse, nearest
from station.twin.ur.paths import JointPath, Path, ToolPath, UnreachableError
from station.twin.ur.poses import Pose, inverse_transform, pose_from_transform, transform_from_pose
from station.twin.ur.profile import Braking, Profile, Trapezoid

RESTING: Joints = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_OFFSET: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
SHORTEST_BRAKING_S = 1e-3
REST_S = 0.05
"""How long the arm is at rest before it counts as steady."""


class Body:
    """The joints, what they do at the moment, and the tool at their end."""

    def __init__(self, joints_rad: Joints, now_s: float, joint_range_rad: float = JOINT_RANGE_RAD) -> None:
        self.joints_rad = joints_rad
        self._joint_range_rad = joint_range_rad
        self.speeds_rad_s: Joints = RESTING
        self.tcp_offset: Pose = NO_OFFSET
        self._path: Path | None = None
        self._profile: Profile | None = None
        self._motion: Callable[[], None] | None = None
        self._paused: Callable[[], None] | None = None
        self._elapsed_s = 0.0
        self._speed = 0.0
        self._travel = 0.0
        self._now_s = now_s
        self._resting_since_s = now_s
        self._tool_cache: tuple[Joints, Pose, Pose] | None = None

    @property
    def moving(self) -> bool:
        """True while a motion has not come to its end."""
        return self._path is not None

    @property
    def steady(self) -> bool:
        """True once the arm has been at rest for `REST_S`."""
        return not self.moving and self._now_s - self._resting_since_s >= REST_S

    def advance(self, now_s: float, scaling: float) -> None:
        """Let time pass up to the clock's, at a share of the commanded speed, 0 to 1."""
        passed_s, self._now_s = now_s - self._now_s, now_s
        if self._path is None or self._profile is None:
            return
        # The scaling stretches time, so that a slowed arm goes exactly the same way.
        self._elapsed_s += passed_s * scaling
        self._travel, self._speed = self._profile.at(self._elapsed_s)
        # A gentle braking near the end would carry beyond the path.
        self._travel = min(self._travel, self._path.length)
        self.joints_rad, (s1, s2, s3, s4, s5, s6) = self._path.at(self._travel)
        pace = self._speed * scaling
        self.speeds_rad_s = pace * s1, pace * s2, pace * s3, pace * s4, pace * s5, pace * s6
        if self._elapsed_s >= self._profile.duration_s:
            self._rest()

    def move_joints(self, target: Joints, speed_rad_s: float, acceleration_rad_s2: float) -> None:
        """Begin a joint motion; joints that are slower than requested slow the others down.

        Raises:
            UnreachableError: the target is out of the joints' range.
        """
        if not self.within_range(target):
            raise UnreachableError("a joint would leave its range")
        path = JointPath.between(self.joints_rad, target)
        speed = min(speed_rad_s, path.speed_limit_rad_s())
        self._begin(path, Trapezoid(path.length, speed, acceleration_rad_s2))
        self._motion = lambda: self.move_joints(target, speed_rad_s, acceleration_rad_s2)

    def move_tool(self, target: Pose, speed_m_s: float, acceleration_m_s2: float) -> None:
        """Begin a straight motion of the tool.

        Raises:
            UnreachableError: part of the way is out of reach, or a joint would have to go faster than it can.
        """
        end = transform_from_pose(target) @ inverse_transform(transform_from_pose(self.tcp_offset))
        path = ToolPath(self.joints_rad, forward(self.joints_rad), end)
        profile = Trapezoid(path.length, speed_m_s, acceleration_m_s2)
        if not self.within_range(path.end_joints) or path.steepest() * profile.peak_speed > 1.0:
            raise UnreachableError("a joint would leave its range or exceed its speed on the straight way")
        self._begin(path, profile)
        self._motion = lambda: self.move_tool(target, speed_m_s, acceleration_m_s2)

    def pause(self, deceleration_rad_s2: float) -> None:
        """Brake as `brake`, and remember the motion for `resume`."""
        # Before the braking, which forgets it.
        motion = self._motion if self.moving else None
        self.brake(deceleration_rad_s2)
        self._paused = motion

    def resume(self) -> None:
        """Begin the motion again that `pause` interrupted; none after a stop in between."""
        if self._paused is not None:
            self._paused()

    def brake(self, deceleration_rad_s2: float) -> None:
        """Come to rest on the path, the leading joint at a deceleration; nothing happens to an arm at rest."""
        self._come_to_rest(max(map(abs, self.speeds_rad_s)), deceleration_rad_s2)

    def brake_tool(self, deceleration_m_s2: float) -> None:
        """Come to rest on the path, the tool at a deceleration; nothing happens to an arm at rest."""
        self._come_to_rest(math.hypot(*self.tool_speed()[:3]), deceleration_m_s2)

    def tool_pose(self) -> Pose:
        """The tool centre point in the base's frame."""
        joints, offset = self.joints_rad, self.tcp_offset
        # Identity is enough: joints and offset are replaced, never changed in place.
        if self._tool_cache is None or self._tool_cache[0] is not joints or self._tool_cache[1] is not offset:
            self._tool_cache = joints, offset, self.forward(joints, offset)
        return self._tool_cache[2]

    def tool_speed(self) -> Pose:
        """The tool's speed in m/s and the rate of its rotation vector in rad/s."""
        if self.speeds_rad_s == RESTING:
            return NO_OFFSET
        step_s = 1e-4
        ahead = [q + v * step_s for q, v in zip(self.joints_rad, self.speeds_rad_s, strict=True)]
        pairs = zip(self.tool_pose(), self.forward(ahead, self.tcp_offset), strict=True)
        x, y, z, rx, ry, rz = ((b - a) / step_s for a, b in pairs)
        return x, y, z, rx, ry, rz

    @staticmethod
    def forward(joints_rad: Sequence[float], offset: Pose) -> Pose:
        """The tool's pose at joint positions."""
        return pose_from_transform(forward(joints_rad) @ transform_from_pose(offset))

    def solve(self, pose: Pose, near_rad: Joints | None = None) -> Joints | None:
        """The joint positions nearest to given or present ones that bring the tool to a pose; None where none do."""
        flange = transform_from_pose(pose) @ inverse_transform(transform_from_pose(self.tcp_offset))
        return nearest(inverse(flange[None])[0], near_rad or self.joints_rad)

    def within_range(self, joints_rad: Joints) -> bool:
        """Return whether each joint is a number and within its range either way."""
        return all(abs(q) <= self._joint_range_rad for q in joints_rad)

    def _come_to_rest(self, pace: float, deceleration: float) -> None:
        self._motion = self._paused = None
        # A motion that has not left its start has no speed to brake from, and is dropped.
        if self._path is None or self._speed == 0.0:
            self._rest()
            return
        # The deceleration may have another unit than the path (rad or m), so that it only sets the time to rest.
        duration_s = max(pace / deceleration, SHORTEST_BRAKING_S)
        self._profile = Braking(self._travel, self._speed, self._speed / duration_s)
        self._elapsed_s = 0.0

    def _begin(self, path: Path, profile: Profile) -> None:
        self._path, self._profile, self._paused = path, profile, None
        self._elapsed_s = self._travel = self._speed = 0.0
        if path.length == 0.0:
            self._rest()

    def _rest(self) -> None:
        self._path = self._profile = None
        self._speed = 0.0
        self.speeds_rad_s = RESTING
        self._resting_since_s = self._now_s
