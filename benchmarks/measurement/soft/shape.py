"""Shapes of soft bodies: the gap between a body's surface and the plane through its foremost point.

Each function takes places in mm and returns the gap in mm, not negative and 0 at the foremost point.
"""

import numpy as np

from station.twin.gel import FloatArray

_STEEPEST = 3.0
"""Slope, mm per mm, with which a gap goes on where the body's own surface would turn vertical."""


def round_gap_mm(distance_mm: FloatArray, radius_mm: float) -> FloatArray:
    """Gap of a sphere, or of a cylinder over the distance from its axis.

    Args:
        distance_mm: distance from the foremost point or line, any shape, not negative.
        radius_mm: radius of the sphere or cylinder.
    """
    # A circle has the slope s where the distance is R·s/√(1 + s²); from there on the gap is a straight line.
    limit_mm = radius_mm * _STEEPEST / np.hypot(1.0, _STEEPEST)
    within = np.minimum(distance_mm, np.float32(limit_mm))
    gap = radius_mm - np.sqrt(radius_mm**2 - np.square(within)) + _STEEPEST * (distance_mm - within)
    return gap.astype(np.float32)


def ellipsoid_gap_mm(x_mm: FloatArray, y_mm: FloatArray, radii_mm: tuple[float, float]) -> FloatArray:
    """Gap of a rounded body with two radii of curvature.

    Args:
        x_mm: across the body, any shape.
        y_mm: along the body, shape as `x_mm`.
        radii_mm: radii of curvature across and along.
    """
    across_mm, along_mm = radii_mm
    distance = np.hypot(x_mm, y_mm * np.float32(np.sqrt(across_mm / along_mm)))
    return round_gap_mm(distance, across_mm)


def ring_gap_mm(distance_mm: FloatArray, middle_mm: float, rim: tuple[float, float], recess_mm: float) -> FloatArray:
    """Gap of a ring, a cup's mouth or an O-ring.

    Args:
        distance_mm: distance from the ring's centre, any shape.
        middle_mm: radius of the rim's middle line.
        rim: half width of the rim's flat top, and the radius of its rounded flanks, mm.
        recess_mm: distance of the inside behind the rim.
    """
    flat_mm, flank_mm = rim
    beside = np.maximum(0.0, np.abs(distance_mm - np.float32(middle_mm)) - np.float32(flat_mm))
    gap = round_gap_mm(beside.astype(np.float32), flank_mm)
    return np.where(distance_mm < middle_mm, np.minimum(gap, np.float32(recess_mm)), gap).astype(np.float32)


def rod_gap_mm(x_mm: FloatArray, y_mm: FloatArray, radius_mm: float, end_mm: float, bend_per_mm: float) -> FloatArray:
    """Gap of a rod along `y_mm` that comes from beyond the gel and has one rounded end.

    Args:
        x_mm: across the rod, any shape.
        y_mm: along the rod, shape as `x_mm`.
        radius_mm: the rod's radius.
        end_mm: where along the rod its end begins to be rounded.
        bend_per_mm: curvature of the rod's axis in the gel's plane.
    """
    from_axis = x_mm - np.float32(bend_per_mm / 2) * np.square(y_mm)
    beyond = np.maximum(0.0, y_mm - np.float32(end_mm))
    return round_gap_mm(np.hypot(from_axis, beyond).astype(np.float32), radius_mm)
