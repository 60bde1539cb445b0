"""From the gel's dent to the change in the image: an optical table over the dent's slope and the place.

The scheme is Taxim's (Si and Yuan, RA-L 7 (2022) 2361): each slope has a second-order polynomial of the place
for each colour. Here the slope enters through a smooth basis (rings of its size times harmonics of its
direction), so that the table is interpolated everywhere and a flat gel changes nothing.
"""

import cv2
import numpy as np
import numpy.typing as npt

from station.twin.gel import GRID_MM, GRID_SHAPE, SENSOR_SHAPE, FloatArray

SLOPE_KNOTS = (0.01, 0.08, 0.18, 0.3, 0.45, 0.6, 0.75, 0.95)
"""Sizes of the slope (mm per mm) at which the table has its values; below the first it is zero."""
HARMONICS = 3
DIRECTIONS = 1 + 2 * HARMONICS
PLACES = 6
_TABLE_SIDE = 121
_TABLE_REACH = SLOPE_KNOTS[-1]


def place_basis(x: FloatArray, y: FloatArray) -> FloatArray:
    """The polynomial's six terms.

    Args:
        x: columns from -1 (left) to 1 (right), any shape.
        y: rows from -1 (top) to 1 (bottom), shape as `x`.

    Returns:
        Shape (6, *x.shape), dtype float32.
    """
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y]).astype(np.float32)


def slope_basis(slope_x: FloatArray, slope_y: FloatArray) -> FloatArray:
    """The table's functions of the slope: linear interpolation between knots, times harmonics of the direction.

    Args:
        slope_x: slope of the dent along the columns, any shape.
        slope_y: slope along the rows, shape as `slope_x`.

    Returns:
        Shape (knots - 1, directions, *slope_x.shape), dtype float32; all zero below the first knot.
    """
    size, angle = np.hypot(slope_x, slope_y), np.arctan2(slope_y, slope_x)
    knots = np.asarray(SLOPE_KNOTS)
    # In the knots' numbers the uneven knots are evenly spaced, so that two neighbouring rings add up to 1.
    position = np.interp(size, knots, np.arange(knots.size))
    rings = [np.maximum(0.0, 1.0 - np.abs(position - ring)) for ring in range(1, knots.size)]
    waves = [np.ones_like(angle)]
    for order in range(1, HARMONICS + 1):
        waves += [np.cos(order * angle), np.sin(order * angle)]
    return np.stack([[ring * wave for wave in waves] for ring in rings]).astype(np.float32)


def slopes(dent: FloatArray, smoothing_mm: float, grid_mm: float = GRID_MM) -> tuple[FloatArray, FloatArray]:
    """The slopes of a dent after the gel's and the lens's smoothing.

    Args:
        dent: mm, on the grid of `station.twin.gel`, shape (320, 240).
        smoothing_mm: standard deviation of the smoothing.
        grid_mm: from one of the grid's points to the next.
    """
    # OpenCV's default border mirrors the dent, which would flatten a contact that the image's border cuts.
    smooth = cv2.GaussianBlur(dent, (0, 0), smoothing_mm / grid_mm, borderType=cv2.BORDER_REPLICATE)
    scale = 1.0 / (2.0 * grid_mm)
    # filter2D correlates, it does not mirror the kernel: right less left, and below less above.
    slope_x = cv2.filter2D(smooth, cv2.CV_32F, np.array([[-scale, 0.0, scale]]), borderType=cv2.BORDER_REPLICATE)
    slope_y = cv2.filter2D(smooth, cv2.CV_32F, np.array([[-scale], [0.0], [scale]]), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(slope_x, np.float32), np.asarray(slope_y, np.float32)


def grid_places() -> FloatArray:
    """The polynomial's terms on the physics' grid, shape (6, 320, 240)."""
    rows, columns = GRID_SHAPE
    x = np.broadcast_to(np.linspace(-1, 1, columns, dtype=np.float32), GRID_SHAPE)
    y = np.broadcast_to(np.linspace(-1, 1, rows, dtype=np.float32)[:, None], GRID_SHAPE)
    return place_basis(x, y)


class Optics:
    """Draws the change that a dent makes in the image.

    Args:
        table: grey levels, shape (knots - 1, directions, places, 3), channels B, G, R.
        smoothing_mm: standard deviation of the smoothing by gel and lens.
        grid_mm: from one of the dent's points to the next.
    """

    def __init__(self, table: FloatArray, smoothing_mm: float, grid_mm: float = GRID_MM) -> None:
        self._smoothing_mm, self._grid_mm = smoothing_mm, grid_mm
        axis = np.linspace(-_TABLE_REACH, _TABLE_REACH, _TABLE_SIDE, dtype=np.float32)
        slope_x, slope_y = np.meshgrid(axis, axis)
        basis = slope_basis(slope_x, slope_y)
        # The basis is summed once: a frame then only reads six tables, one for each term of the place, at its slopes.
        self._tables = np.einsum("kdyx,kdpc->pyxc", basis, table).astype(np.float32)
        # Repeated for each channel: OpenCV's sum of products takes no broadcasting, and is ten times faster.
        self._places = np.repeat(grid_places()[..., None], 3, axis=-1)

    def change(self, dent: FloatArray, gain: FloatArray | None = None) -> FloatArray:
        """The change in grey levels that a dent makes, at the sensor's resolution.

        Args:
            dent: mm, shape (320, 240), positive where the gel is pushed in.
            gain: factor for each channel, shape (3,); 1 where left out.

        Returns:
            Shape (640, 480, 3), dtype float32, channels B, G, R; exactly 0 where the gel is flat.
        """
        coarse = np.zeros((*GRID_SHAPE, 3), np.float32)
        slope_x, slope_y = slopes(dent, self._smoothing_mm, self._grid_mm)
        size = cv2.magnitude(slope_x, slope_y)
        steep = size > SLOPE_KNOTS[0]
        # Only the box around the steep part is computed: a contact mostly covers a part of the image.
        rows, columns = np.flatnonzero(steep.any(axis=1)), np.flatnonzero(steep.any(axis=0))
        if rows.size:
            box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            found = self._tables_at(slope_x[box], slope_y[box], size[box], self._places[(slice(None), *box)])
            coarse[box] = found if gain is None else found * gain
        height, width = SENSOR_SHAPE
        return np.asarray(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)

    def _tables_at(self, slope_x: FloatArray, slope_y: FloatArray, size: npt.NDArray, places: FloatArray) -> FloatArray:
        """Interpolate each place's table at the slopes and add up; slopes beyond the table count as its rim."""
        scale = (_TABLE_SIDE - 1) / (2 * _TABLE_REACH)
        # Just inside the rim, where rounding would mix in the zeros that remap finds beyond it.
        within = np.minimum(1.0, (_TABLE_REACH * 0.999) / np.maximum(size, 1e-9)).astype(np.float32)
        map_x = (slope_x * within + _TABLE_REACH) * np.float32(scale)
        map_y = (slope_y * within + _TABLE_REACH) * np.float32(scale)
        total = np.zeros((*size.shape, 3), np.float32)
        for table, place in zip(self._tables, places, strict=True):
            cv2.accumulateProduct(cv2.remap(table, map_x, map_y, cv2.INTER_LINEAR), place, total)
        # Interpolation carries the table's first values down to slope 0; below the first knot nothing may change.
        return np.asarray(cv2.copyTo(total, (size > SLOPE_KNOTS[0]).astype(np.uint8)), np.float32)
