"""Offset of a tool's pose along the tool's own axes."""

from math import cos, hypot, sin

from station.devices.arm.messages import Position, Six


def offset_pose(pose: Six, offset_mm: Position) -> Six:
    """Return a pose (m, rotation vector in rad) with an offset along its own x, y and z, with the same orientation."""
    x, y, z, *vector = pose
    angle = hypot(*vector)
    offset = [value / 1000 for value in offset_mm]
    if angle > 0:
        # Rodrigues' formula: v cos + (k x v) sin + k (k . v) (1 - cos), with k the axis of the rotation.
        axis = [value / angle for value in vector]
        along = sum(a * v for a, v in zip(axis, offset, strict=True)) * (1 - cos(angle))
        (a, b, c), (u, v, w) = axis, offset
        crossed = (b * w - c * v, c * u - a * w, a * v - b * u)
        offset = [
            cos(angle) * value + sin(angle) * cross + along * part
            for value, cross, part in zip(offset, crossed, axis, strict=True)
        ]
    return x + offset[0], y + offset[1], z + offset[2], vector[0], vector[1], vector[2]
