"""The skin of each fruit as a height map: its depth below its own highest points, in mm.

Sizes from observation of the fruit: strawberry achenes 1.5 to 2.5 by 1 to 1.5 mm in pits, raspberry drupelets of
2 to 3 mm, a blueberry's crown of five lobes around a hollow.
"""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from station.twin.gel import FloatArray

Texture = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]
"""Takes x and y in mm on the fruit, with its generator; gives depths in mm, not negative."""

_REACH_MM = 14.0


def smooth(x_mm: FloatArray, _y_mm: FloatArray, _generator: np.random.Generator) -> FloatArray:
    """A skin with nothing on it."""
    return np.zeros_like(x_mm)


def achenes(x_mm: FloatArray, y_mm: FloatArray, generator: np.random.Generator) -> FloatArray:
    """A strawberry's pits with a seed in each."""
    depth = np.zeros_like(x_mm)
    for centre_x, centre_y in _lattice(3.4, 0.5, generator):
        # Drawn before the check below: the skin must not depend on which part of the fruit the sensor covers.
        length_mm, width_mm = generator.uniform(1.5, 2.5), generator.uniform(1.0, 1.5)
        # Beyond 4.5 mm even the longest pit is at most 0.012 mm deep.
        box = _near(x_mm, y_mm, centre_x, centre_y, 4.5)
        if box is None:
            continue
        across, along = (x_mm[box] - centre_x) / (width_mm / 2), (y_mm[box] - centre_y) / (length_mm / 2)
        squared = np.square(across) + np.square(along)
        pit = 0.30 * np.exp(-squared / 4.0)
        seed = 0.28 * np.sqrt(np.maximum(0.0, 1.0 - squared))
        depth[box] += (pit - seed).astype(np.float32)
    return depth - depth.min()


def drupelets(x_mm: FloatArray, y_mm: FloatArray, generator: np.random.Generator) -> FloatArray:
    """A raspberry's drupelets: caps of spheres side by side, with grooves between them."""
    height = np.full_like(x_mm, -1.0)
    for centre_x, centre_y in _lattice(2.3, 0.25, generator):
        # Drawn before the check, as for the achenes.
        radius_mm, lift_mm = generator.uniform(1.25, 1.6), generator.uniform(-0.12, 0.0)
        box = _near(x_mm, y_mm, centre_x, centre_y, radius_mm)
        if box is None:
            continue
        squared = np.square(x_mm[box] - centre_x) + np.square(y_mm[box] - centre_y)
        cap = np.sqrt(np.maximum(0.0, radius_mm**2 - squared)) - radius_mm + lift_mm
        height[box] = np.maximum(height[box], cap)
    return (height.max() - height).astype(np.float32)


def calyx(x_mm: FloatArray, y_mm: FloatArray, generator: np.random.Generator) -> FloatArray:
    """A blueberry's smooth skin with its crown, turned anywhere: often out of the gel's sight."""
    angle, distance_mm = generator.uniform(0, 2 * np.pi), generator.uniform(4.5, 9.0)
    lobe_turn = generator.uniform(0, 2 * np.pi)
    dx, dy = x_mm - distance_mm * np.cos(angle), y_mm - distance_mm * np.sin(angle)
    radius, around = np.hypot(dx, dy), np.arctan2(dy, dx)
    lobes = 0.7 + 0.3 * np.cos(5 * (around - lobe_turn))
    crown = 0.45 * lobes * np.exp(-np.square((radius - 2.6) / 0.45))
    hollow = 0.5 * np.exp(-np.square(radius / 1.6))
    depth = hollow - crown
    return (depth - depth.min()).astype(np.float32)


def _lattice(pitch_mm: float, jitter: float, generator: np.random.Generator) -> npt.NDArray[np.float64]:
    """Centres on a jittered hexagonal lattice, shape (n, 2), mm."""
    rows = np.arange(-_REACH_MM, _REACH_MM, pitch_mm * np.sqrt(3) / 2)
    columns = np.arange(-_REACH_MM, _REACH_MM, pitch_mm)
    shift = generator.uniform(0, pitch_mm, 2)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    x = x + (np.arange(rows.size) % 2)[:, None] * (pitch_mm / 2)
    centres = np.stack([x, y], axis=-1).reshape(-1, 2) + shift
    return centres + generator.uniform(-0.5, 0.5, centres.shape) * jitter * pitch_mm


def _near(
    x_mm: FloatArray, y_mm: FloatArray, centre_x: float, centre_y: float, reach_mm: float
) -> npt.NDArray[np.bool_] | None:
    """The places within reach of a centre, or None where there are none."""
    near = (np.abs(x_mm - centre_x) < reach_mm) & (np.abs(y_mm - centre_y) < reach_mm)
    return near if near.any() else None
