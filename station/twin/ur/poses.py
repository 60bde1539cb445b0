"""Rotations and tool poses as the controller writes them: x, y, z in m and a rotation vector in rad."""

import math

import numpy as np
import numpy.typing as npt

Transform = npt.NDArray[np.float64]
"""Homogeneous transforms, shape (..., 4, 4), dtype float64, lengths in m."""

Pose = tuple[float, float, float, float, float, float]
"""x, y, z in m and the rotation vector rx, ry, rz in rad."""


def rotation_from_vector(vector: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Rotation matrix, shape (3, 3), dtype float64, of a rotation vector, shape (3,), rad (Rodrigues' formula)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)


def vector_from_rotation(rotation: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Rotation vector, shape (3,), 0 to pi rad, of a matrix, (3, 3), by the unit quaternion: safe near 0 and pi."""
    r = rotation.tolist()
    # Shepperd's method: of the four squared components, the largest is taken first.
    squares = (
        r[0][0] + r[1][1] + r[2][2],
        r[0][0] - r[1][1] - r[2][2],
        r[1][1] - r[0][0] - r[2][2],
        r[2][2] - r[0][0] - r[1][1],
    )
    largest = squares.index(max(squares))
    if largest == 0:
        w, x, y, z = 1 + squares[0], r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]
    elif largest == 1:
        w, x, y, z = r[2][1] - r[1][2], 1 + squares[1], r[0][1] + r[1][0], r[0][2] + r[2][0]
    elif largest == 2:
        w, x, y, z = r[0][2] - r[2][0], r[0][1] + r[1][0], 1 + squares[2], r[1][2] + r[2][1]
    else:
        w, x, y, z = r[1][0] - r[0][1], r[0][2] + r[2][0], r[1][2] + r[2][1], 1 + squares[3]
    # A quaternion and its negative are one rotation; with w of 0 or more its angle is pi at most.
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return np.zeros(3)
    scale = 2.0 * math.atan2(length, w) / length
    return np.array([x * scale, y * scale, z * scale])


def transform_from_pose(pose: Pose) -> Transform:
    """Transform, shape (4, 4), of a pose."""
    transform = np.eye(4)
    transform[:3, :3] = rotation_from_vector(np.array(pose[3:]))
    transform[:3, 3] = pose[:3]
    return transform


def pose_from_transform(transform: Transform) -> Pose:
    """Pose of a transform of shape (4, 4)."""
    x, y, z = transform[:3, 3].tolist()
    rx, ry, rz = vector_from_rotation(transform[:3, :3]).tolist()
    return x, y, z, rx, ry, rz


def inverse_transform(transform: Transform) -> Transform:
    """Inverse of transforms, shape (..., 4, 4)."""
    turned = np.swapaxes(transform[..., :3, :3], -1, -2)
    inverse = np.zeros_like(transform)
    inverse[..., :3, :3] = turned
    inverse[..., :3, 3:] = -turned @ transform[..., :3, 3:]
    inverse[..., 3, 3] = 1.0
    return inverse
