"""The gel's surface under a fruit: the dent, and the ground truth of a measurement."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from station.twin.fruit import Fruit
from station.twin.gel import (
    GRID_SHAPE,
    GRID_STEP,
    SENSOR_SHAPE,
    FloatArray,
    Gel,
    dent_mm,
    visible_edge_mm,
)
from station.twin.squeeze import Squeezed

Mask = npt.NDArray[np.uint8]

MIDDLE_X_PX, MIDDLE_Y_PX = SENSOR_SHAPE[1] / 2, SENSOR_SHAPE[0] / 2
"""Middle of the sensor's image."""
_SKIN_MM, _BRIDGE_MM, _LEVELLED_MM = 0.1, 0.25, 2.0
"""Smoothing of the texture: in the imprint, in the outline, and what counts as its mean level."""
_BRIDGED = 0.3
"""The part of the texture's depth that shows in the contact's outline; the skin and the gel yield for the rest."""
_FULL_IMPRINT_PRESSURE = 0.4
"""Mean pressure over the gel's modulus at which the texture is pressed in fully."""


@dataclass(frozen=True, slots=True)
class Pose:
    """Place and orientation of the fruit on the gel."""

    x_px: float = MIDDLE_X_PX
    y_px: float = MIDDLE_Y_PX
    turn_deg: float = 0.0
    tilt_deg: float = 0.0
    """Lean of the fruit's surface against the gel, about the image's rows."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """The gel at one closing."""

    dent: FloatArray
    """mm, shape (320, 240)."""
    true_mask: Mask
    """The contact inside its edge, shape (640, 480), 0 or 255."""
    mm_per_px: float

    @property
    def true_area_px(self) -> int:
        """The contact's area."""
        return int(np.count_nonzero(self.true_mask))

    @property
    def true_area_mm2(self) -> float:
        """The contact's area."""
        return self.true_area_px * self.mm_per_px**2


class FruitOnGel:
    """One fruit in one pose over the gel, made once and pressed to any depth."""

    def __init__(self, fruit: Fruit, pose: Pose, gel: Gel) -> None:
        self._fruit, self._gel = fruit, gel
        rows, columns = np.indices(GRID_SHAPE, dtype=np.float32)
        # A grid point is at the middle of its pixels, as cv2.resize takes it when it scales back to them.
        centre = (GRID_STEP - 1) / 2
        x_mm = (columns * GRID_STEP + centre - pose.x_px) * np.float32(gel.mm_per_px)
        y_mm = (rows * GRID_STEP + centre - pose.y_px) * np.float32(gel.mm_per_px)
        turn = np.deg2rad(pose.turn_deg)
        across = (x_mm * np.cos(turn) + y_mm * np.sin(turn)).astype(np.float32)
        along = (y_mm * np.cos(turn) - x_mm * np.sin(turn)).astype(np.float32)
        lean = np.tan(np.deg2rad(pose.tilt_deg))
        # A leant surface touches beside its middle, lean²·R/2 earlier: added, so that first contact is at approach 0.
        shape = fruit.gap_mm(across, along) + lean * x_mm + 0.5 * lean**2 * fruit.surface.radius_mm
        texture = fruit.texture_mm(across, along)
        grid_mm = gel.mm_per_px * GRID_STEP
        coarse = cv2.GaussianBlur(texture, (0, 0), _BRIDGE_MM / grid_mm)
        wide = cv2.GaussianBlur(texture, (0, 0), _LEVELLED_MM / grid_mm)
        # Without its mean level, which the smoothed surface of `gap_mm` already contains.
        self._relief = np.asarray(cv2.GaussianBlur(texture, (0, 0), _SKIN_MM / grid_mm) - wide, np.float32)
        # Raised texture would make the gap negative near the foremost point; `dent_mm` needs 0 or more.
        self._gap = np.maximum(0.0, shape + _BRIDGED * (coarse - wide)).astype(np.float32)
        height, width = SENSOR_SHAPE
        # The true mask is made at the sensor's resolution: on the grid its edge would have steps of two pixels.
        self._fine_gap = np.asarray(cv2.resize(self._gap, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)

    def pressed(self, squeezed: Squeezed) -> Footprint:
        """The gel under the fruit at one closing, from `Squeeze.at`."""
        approach = squeezed.approach_mm
        if approach <= 0:
            untouched = np.zeros(GRID_SHAPE, np.float32), np.zeros(SENSOR_SHAPE, np.uint8)
            return Footprint(*untouched, self._gel.mm_per_px)
        surface = self._fruit.surface
        radius_mm = surface.radius_mm
        contact_radius_mm = float(np.sqrt(approach * radius_mm))
        dent = dent_mm(self._gap, approach, surface, self._gel)
        pressure_mpa = squeezed.force_n / (np.pi * contact_radius_mm**2)
        imprint = min(1.0, pressure_mpa / (_FULL_IMPRINT_PRESSURE * self._gel.modulus_mpa))
        # 1 at the foremost point, 0 at the contact's edge, where no pressure presses the texture in.
        within = np.maximum(0.0, 1.0 - self._gap * np.float32(2.0 / approach))
        # The gel has its share of the approach only; where the skin is deep, it is dented less.
        dent = dent * np.float32(squeezed.gel_share) - np.float32(imprint) * self._relief * within
        # A paraboloid's slope at the edge is a/R, of which the gel has its share; its gap goes with the radius squared.
        edge_mm = visible_edge_mm(contact_radius_mm, squeezed.gel_share * contact_radius_mm / radius_mm)
        limit_mm = 0.5 * approach * (edge_mm / contact_radius_mm) ** 2
        # Pits of the skin inside the edge belong to the contact area.
        inside = _filled(self._fine_gap < limit_mm)
        # A pit deeper than the dent touches nothing: it does not pull the gel out.
        return Footprint(np.maximum(dent, 0.0).astype(np.float32), inside, self._gel.mm_per_px)


def _filled(inside: npt.NDArray[np.bool_]) -> Mask:
    """The mask with its holes filled."""
    mask = np.where(inside, 255, 0).astype(np.uint8)
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(mask, outlines, -1, 255, cv2.FILLED), np.uint8)
