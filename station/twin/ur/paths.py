"""The ways that a motion takes through the joints' space."""

import math
from dataclasses import dataclass

import numpy as np

from station.twin.ur.kinematics import JOINT_SPEED_LIMITS_RAD_S, Joints, inverse, nearest
from station.twin.ur.poses import Transform, rotation_from_vector, vector_from_rotation

SAMPLE_M = 0.001
MOST_SAMPLES = 500
# Of a joint between two samples: a larger step is a change of the solution's branch, as at a singularity.
JUMP_RAD = 0.5


class UnreachableError(Exception):
    """The arm cannot go there, or not on this way."""


@dataclass(frozen=True, slots=True)
class JointPath:
    """Straight in the joints' space; its length is the leading joint's way in rad."""

    start: Joints
    slope: Joints
    length: float

    @classmethod
    def between(cls, start: Joints, end: Joints) -> "JointPath":
        """The way from a joint position to another."""
        deltas = [b - a for a, b in zip(start, end, strict=True)]
        length = max(abs(delta) for delta in deltas)
        q1, q2, q3, q4, q5, q6 = (delta / length if length else 0.0 for delta in deltas)
        return cls(start, (q1, q2, q3, q4, q5, q6), length)

    def speed_limit_rad_s(self) -> float:
        """The leading joint's speed at which the first joint reaches its own limit."""
        used = [limit / abs(s) for limit, s in zip(JOINT_SPEED_LIMITS_RAD_S, self.slope, strict=True) if s]
        return min(used, default=JOINT_SPEED_LIMITS_RAD_S[0])

    def at(self, travel: float) -> tuple[Joints, Joints]:
        """Joint positions and slopes after a travel in rad."""
        return _along(self.start, self.slope, travel), self.slope


class ToolPath:
    """Straight for the flange, with an even turn; solved for the joints beforehand, millimetre by millimetre.

    The length is the flange's way in m, or its turn in rad where that is the larger number.
    """

    def __init__(self, start_joints: Joints, start: Transform, end: Transform) -> None:
        """Solve the way from joint positions and the flange there to where it has to go, both shape (4, 4).

        Raises:
            UnreachableError: part of the way is out of reach or leads through a singularity.
        """
        way = end[:3, 3] - start[:3, 3]
        turn = vector_from_rotation(start[:3, :3].T @ end[:3, :3])
        self.length = float(max(np.linalg.norm(way), np.linalg.norm(turn)))
        pieces = min(max(math.ceil(self.length / SAMPLE_M), 2), MOST_SAMPLES)
        fractions = np.linspace(0.0, 1.0, pieces + 1)
        flanges = np.tile(np.eye(4), (pieces + 1, 1, 1))
        flanges[:, :3, 3] = start[:3, 3] + fractions[:, None] * way
        flanges[:, :3, :3] = [start[:3, :3] @ rotation_from_vector(fraction * turn) for fraction in fractions]
        self._joints = _follow(start_joints, inverse(flanges))
        self._pieces = pieces
        # It divides: a way of no length has pieces of 1.0, on which the slopes are about 0.
        self._piece = self.length / pieces or 1.0

    @property
    def end_joints(self) -> Joints:
        """Joint positions at the path's end, rad."""
        return self._joints[-1]

    def steepest(self) -> float:
        """The share of its joint's speed limit, per m/s of the tool, that is used at the way's worst place."""
        steps = np.abs(np.diff(np.array(self._joints), axis=0)) / self._piece
        return float((steps / np.array(JOINT_SPEED_LIMITS_RAD_S)).max())

    def at(self, travel: float) -> tuple[Joints, Joints]:
        """Joint positions and slopes after a travel in m."""
        piece = min(int(travel / self._piece), self._pieces - 1)
        rest = travel - piece * self._piece
        a, b = self._joints[piece], self._joints[piece + 1]
        s1, s2, s3, s4, s5, s6 = ((y - x) / self._piece for x, y in zip(a, b, strict=True))
        slope = s1, s2, s3, s4, s5, s6
        return _along(a, slope, rest), slope


Path = JointPath | ToolPath
"""A way of a length, in rad of the leading joint or in m of the tool; its slopes are in rad per unit of length."""


def _along(start: Joints, slope: Joints, travel: float) -> Joints:
    q1, q2, q3, q4, q5, q6 = (q + s * travel for q, s in zip(start, slope, strict=True))
    return q1, q2, q3, q4, q5, q6


def _follow(start_joints: Joints, solutions: np.ndarray) -> list[Joints]:
    # From where the joints are, since several solutions bring the flange there.
    joints = [start_joints]
    for place in solutions[1:]:
        found = nearest(place, joints[-1])
        if found is None:
            raise UnreachableError("part of the straight way is out of the arm's reach")
        if max(abs(b - a) for a, b in zip(joints[-1], found, strict=True)) > JUMP_RAD:
            raise UnreachableError("the straight way leads through a singularity")
        joints.append(found)
    return joints
