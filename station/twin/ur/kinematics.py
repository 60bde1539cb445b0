"""The UR10e's nominal kinematics.

Source of the numbers: Universal Robots, "DH Parameters for calculations of kinematics and dynamics" (table UR10e), and
the UR10e's data sheet (joint ranges and speeds). A real arm's calibrated parameters differ from these by a few tenths
of a millimetre; the twin's arm is the nominal one.
"""

import math

import numpy as np
import numpy.typing as npt

from station.twin.ur.poses import Transform, inverse_transform

Joints = tuple[float, float, float, float, float, float]
"""Base, shoulder, elbow, wrist 1, 2 and 3 in rad."""

D1_M, D4_M, D5_M, D6_M = 0.1807, 0.17415, 0.11985, 0.11655
A2_M, A3_M = -0.6127, -0.57155
LINKS: tuple[tuple[float, float, float], ...] = (
    (0.0, D1_M, math.pi / 2),
    (A2_M, 0.0, 0.0),
    (A3_M, 0.0, 0.0),
    (0.0, D4_M, math.pi / 2),
    (0.0, D5_M, -math.pi / 2),
    (0.0, D6_M, 0.0),
)
"""a in m, d in m and alpha in rad of each joint's link."""

JOINT_RANGE_RAD = 2 * math.pi
ROUNDING = 1e-9
_SLOW, _FAST = math.radians(120.0), math.radians(180.0)
JOINT_SPEED_LIMITS_RAD_S: Joints = (_SLOW, _SLOW, _FAST, _FAST, _FAST, _FAST)


def link_transform(joint: int, angle_rad: npt.NDArray[np.float64] | float) -> Transform:
    """Transform of the link of joint 0 to 5, turned by angles of any shape (...).

    Returns:
        Shape (..., 4, 4).
    """
    a, d, alpha = LINKS[joint]
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    ca, sa = math.cos(alpha), math.sin(alpha)
    transform = np.zeros((*np.shape(angle_rad), 4, 4))
    transform[..., 0, 0], transform[..., 0, 1], transform[..., 0, 2], transform[..., 0, 3] = c, -s * ca, s * sa, a * c
    transform[..., 1, 0], transform[..., 1, 1], transform[..., 1, 2], transform[..., 1, 3] = s, c * ca, -c * sa, a * s
    transform[..., 2, 1], transform[..., 2, 2], transform[..., 2, 3] = sa, ca, d
    transform[..., 3, 3] = 1.0
    return transform


def forward(joints_rad: npt.ArrayLike) -> Transform:
    """Transform from the base to the flange at joint positions, shape (..., 6).

    Returns:
        Shape (..., 4, 4).
    """
    q = np.asarray(joints_rad, dtype=np.float64)
    flange = link_transform(0, q[..., 0])
    for joint in range(1, 6):
        flange = flange @ link_transform(joint, q[..., joint])
    return flange


def inverse(flange: Transform) -> npt.NDArray[np.float64]:
    """All joint positions that bring the flange to places, base to flange, shape (n, 4, 4), in closed form.

    The geometry follows from the three parallel axes of shoulder, elbow and wrist 1: the base angle from the wrist's
    distance to the plane of the upper arm, wrist 2 from the tool's, and the rest is a triangle. Where wrist 2 is
    straight, wrist 3 is free and taken as 0.

    Returns:
        Shape (n, 8, 6), rad within -pi to pi; NaN where a branch has no solution.
    """
    count = flange.shape[0]
    branches = np.array([[s1, s5, s3] for s1 in (1, -1) for s5 in (1, -1) for s3 in (1, -1)], dtype=np.float64)
    shoulder, wrist, elbow = branches.T
    target = np.broadcast_to(flange[:, None], (count, 8, 4, 4))
    # Branches without a solution become NaN on purpose.
    with np.errstate(invalid="ignore", divide="ignore"):
        # Where the axes of wrist 2 and 3 meet: neither of them moves this point.
        centre = target[..., :3, 3] - D6_M * target[..., :3, 2]
        radius = np.hypot(centre[..., 0], centre[..., 1])
        q1 = np.arctan2(centre[..., 1], centre[..., 0]) + shoulder * np.arccos(_cosine(D4_M / radius)) + math.pi / 2
        s1, c1 = np.sin(q1), np.cos(q1)
        # The flange's distance to the plane of the upper arm is D4 + D6·cos(q5).
        reach = target[..., 0, 3] * s1 - target[..., 1, 3] * c1
        q5 = wrist * np.arccos(_cosine((reach - D4_M) / D6_M))
        s5 = np.sin(q5)
        x_axis, y_axis = target[..., :3, 0], target[..., :3, 1]
        # Divided by s5 for its sign: between the two wrist branches q6 differs by half a turn.
        q6 = np.arctan2(
            (-y_axis[..., 0] * s1 + y_axis[..., 1] * c1) / s5, (x_axis[..., 0] * s1 - x_axis[..., 1] * c1) / s5
        )
        q6 = np.where(np.abs(s5) < 1e-9, 0.0, q6)
        hand = link_transform(4, q5) @ link_transform(5, q6)
        wrist_1 = inverse_transform(link_transform(0, q1)) @ target @ inverse_transform(hand)
        x, y = wrist_1[..., 0, 3], wrist_1[..., 1, 3]
        distance = np.hypot(x, y)
        q3 = elbow * np.arccos(_cosine((distance**2 - A2_M**2 - A3_M**2) / (2 * A2_M * A3_M)))
        # Universal Robots' arm lengths are negative: the arm extends along -x, hence the signs.
        q2 = np.arctan2(-y, -x) - np.arcsin(_cosine(-A3_M * np.sin(q3) / distance))
        # The three axes are parallel, so that their angles add up.
        turned = np.arctan2(wrist_1[..., 1, 0], wrist_1[..., 0, 0])
        q4 = turned - q2 - q3
    solutions = np.stack([q1, q2, q3, q4, q5, q6], axis=-1)
    return (solutions + math.pi) % (2 * math.pi) - math.pi


def nearest(solutions: npt.NDArray[np.float64], near_rad: npt.ArrayLike) -> Joints | None:
    """The one of `inverse`'s solutions, shape (8, 6), nearest to given joints, whole turns within their range included.

    Returns:
        None where no branch has a solution.
    """
    near = np.asarray(near_rad, dtype=np.float64)
    usable = solutions[~np.isnan(solutions).any(axis=-1)]
    if usable.size == 0:
        return None
    turned = usable + 2 * math.pi * np.round((near - usable) / (2 * math.pi))
    outside = np.abs(turned) > JOINT_RANGE_RAD + ROUNDING
    turned = np.where(outside, turned - 2 * math.pi * np.sign(turned), turned)
    # By the joint with the longest way, which is the length of a joint motion.
    best = turned[np.abs(turned - near).max(axis=-1).argmin()]
    q1, q2, q3, q4, q5, q6 = best.tolist()
    return q1, q2, q3, q4, q5, q6


def _cosine(value: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    # Rounding may carry a stretched arm's cosine past 1; what is past it by more has no solution.
    return np.where(np.abs(value) <= 1 + ROUNDING, np.clip(value, -1.0, 1.0), np.nan)
