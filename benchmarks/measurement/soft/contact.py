"""Soft body on the gel: dent, true mask and force at a compression, by two beds of springs that meet.

The gel is a bed of springs under its surface and the body another one (a Winkler foundation, K. L. Johnson,
Contact Mechanics, 1985, section 4.3, for both). That is coarser than Hertz's contact, but it gives what a soft body
does and Hertz does not: a flat, shallow plateau with a rounded rim, and an area that grows until it fills the gel.

Compression here is the approach of body and gel alone: what the body's far side and the other finger take of the
gripper's closing is not in it.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from station.twin.contact import Footprint, Mask, Pose
from station.twin.gel import GRID_SHAPE, GRID_STEP, SENSOR_SHAPE, FloatArray, Gel

from .body import SoftBody, SoftKind
from .skin import relief, waviness

GEL_MM = (18.4, 15.8)
"""Height and width of the gel as the image sees it; the part of a body beyond touches nothing."""
GEL_SPRING_N_PER_MM3 = 0.1
"""Stiffness of the gel's bed. An estimate: a layer of 2.27 mm of 0.12 MPa has 0.05 with free sides, 0.46 without."""
_BENT_MM, _DRAWN_MM, _DRAWN_SHARE = 0.2, 1.2, 0.3
"""The gel's surface bends over the first length; a share of the dent is drawn down over the second. Estimates."""
_WAVE_LENGTH_MM = 5.0
_SKIN_MM = 0.08
"""Smoothing of the relief by the gel's coating."""
_OUTSET_MM, _OUTSET_SLOPE, _OUTSET_MOST_MM = 0.2, 0.3, 0.3
"""Distance of the visible edge outside the contact's for each unit of the dent's slope there, the slope from which on
it counts, and the most of it. Measured on rendered rods and rings: the colours saturate at steep flanks."""
_STEEP_QUANTILE = 0.75
_DEEPEST_MM = 8.0
_KNOTS = 800


@dataclass(frozen=True, slots=True)
class SoftFootprint(Footprint):
    """The gel under a soft body at one compression."""

    compression_mm: float
    """Approach of body and gel since the first touch; negative before it."""
    force_n: float
    """The body's pressure summed over the whole gel, of which the image shows the middle."""


class SoftOnGel:
    """One soft body in one pose over the gel, made once and pressed to any compression."""

    def __init__(self, body: SoftBody, pose: Pose | None = None, gel: Gel | None = None) -> None:
        pose, gel = pose or Pose(), gel or Gel()
        self._body, self._gel = body, gel
        self._grid_mm = gel.mm_per_px * GRID_STEP
        top, left = (
            max(0, round((size_mm / self._grid_mm - side) / 2))
            for size_mm, side in zip(GEL_MM, GRID_SHAPE, strict=True)
        )
        self._margins = top, left
        self._grid = GRID_SHAPE[0] + 2 * top, GRID_SHAPE[1] + 2 * left
        self._gap = self._gap_mm(pose)
        skin = relief(body.skin, body.pitch_mm, self._grid, self._grid_mm, body.seed)
        self._relief = np.asarray(cv2.GaussianBlur(skin, (0, 0), _SKIN_MM / self._grid_mm), np.float32)
        height, width = SENSOR_SHAPE
        seen = self._seen(self._gap)
        self._fine_gap = np.asarray(cv2.resize(seen, (width, height), interpolation=cv2.INTER_LINEAR), np.float32)
        down, across = np.gradient(seen, self._grid_mm)
        first_mpa_per_mm = body.foundation.plateau_mpa / body.foundation.knee_mm
        self._edge_slope = np.hypot(down, across) * first_mpa_per_mm / (first_mpa_per_mm + GEL_SPRING_N_PER_MM3)
        # The overlap of the two undeformed surfaces is shared so that both springs have the same pressure.
        flattened = np.linspace(0.0, _DEEPEST_MM, _KNOTS, dtype=np.float32)
        self._pressures = body.foundation.pressure_mpa(flattened)
        self._overlaps = flattened + self._pressures / np.float32(GEL_SPRING_N_PER_MM3)

    def compression_mm(self, covered: float) -> float:
        """The compression at which the contact covers a share of the image.

        Args:
            covered: 0 to 1.
        """
        return float(np.quantile(self._fine_gap[::4, ::4], covered))

    def pressed(self, compression_mm: float) -> SoftFootprint:
        """The gel under the body at one compression.

        Args:
            compression_mm: approach of body and gel since the first touch; 0 or less touches nothing.
        """
        if compression_mm <= 0:
            untouched = np.zeros(GRID_SHAPE, np.float32), np.zeros(SENSOR_SHAPE, np.uint8)
            return SoftFootprint(*untouched, self._gel.mm_per_px, compression_mm, 0.0)
        overlap = np.maximum(0.0, np.float32(compression_mm) - self._gap)
        pressure = np.interp(overlap, self._overlaps, self._pressures).astype(np.float32)
        dent = self._surface(pressure / np.float32(GEL_SPRING_N_PER_MM3))
        if self._body.relief_mm:
            imprint = np.minimum(1.0, pressure / np.float32(self._body.full_imprint_mpa))
            dent += np.float32(self._body.relief_mm) * imprint * self._relief
        force_n = float(pressure.sum()) * self._grid_mm**2
        mask = self._mask(compression_mm)
        seen = np.maximum(self._seen(dent), 0.0)
        return SoftFootprint(seen.astype(np.float32), mask, self._gel.mm_per_px, compression_mm, force_n)

    def _gap_mm(self, pose: Pose) -> FloatArray:
        rows, columns = np.indices(self._grid, dtype=np.float32)
        centre = (GRID_STEP - 1) / 2
        x_mm = ((columns - self._margins[1]) * GRID_STEP + centre - pose.x_px) * np.float32(self._gel.mm_per_px)
        y_mm = ((rows - self._margins[0]) * GRID_STEP + centre - pose.y_px) * np.float32(self._gel.mm_per_px)
        turn = np.deg2rad(pose.turn_deg)
        across = (x_mm * np.cos(turn) + y_mm * np.sin(turn)).astype(np.float32)
        along = (y_mm * np.cos(turn) - x_mm * np.sin(turn)).astype(np.float32)
        gap = self._body.gap_mm(across, along) + np.float32(np.tan(np.deg2rad(pose.tilt_deg))) * along
        if self._body.wave_mm:
            wave = waviness(_WAVE_LENGTH_MM, self._grid, self._grid_mm, self._body.seed)
            gap += np.float32(self._body.wave_mm) * wave
        # The first touch that the image shows counts as the first; what touches the gel beside it earlier is cut off.
        return np.maximum(0.0, gap - self._seen(gap).min()).astype(np.float32)

    def _surface(self, dent: FloatArray) -> FloatArray:
        """The dent as the gel's bent surface: a spring bed's alone would have sharp edges."""
        bent = cv2.GaussianBlur(dent, (0, 0), _BENT_MM / self._grid_mm, borderType=cv2.BORDER_REPLICATE)
        # The wide part is smooth, so that a quarter of the resolution is enough for it.
        rows, columns = self._grid
        small = cv2.resize(dent, (columns // 4, rows // 4), interpolation=cv2.INTER_AREA)
        wide = cv2.GaussianBlur(small, (0, 0), _DRAWN_MM / (4 * self._grid_mm), borderType=cv2.BORDER_REPLICATE)
        drawn = cv2.resize(wide, (columns, rows), interpolation=cv2.INTER_CUBIC)
        return ((1.0 - _DRAWN_SHARE) * bent + _DRAWN_SHARE * drawn).astype(np.float32)

    def _seen(self, field: FloatArray) -> FloatArray:
        """The part of a field on the gel within the image."""
        top, left = self._margins
        return field[top : top + GRID_SHAPE[0], left : left + GRID_SHAPE[1]]

    def _mask(self, compression_mm: float) -> Mask:
        """Contact of body and gel in the image, out to its visible edge, which people would annotate.

        A ring's inside counts where it touches; other holes are filled.
        """
        mask = np.where(self._fine_gap < compression_mm, 255, 0).astype(np.uint8)
        outset_px = self._outset_mm(compression_mm) / self._gel.mm_per_px
        if outset_px >= 1:
            outside = cv2.distanceTransform(cv2.bitwise_not(mask), cv2.DIST_L2, 3)
            mask = np.where(outside <= outset_px, 255, 0).astype(np.uint8)
        if self._body.kind is SoftKind.RING:
            return mask
        outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        return np.asarray(cv2.drawContours(mask, outlines, -1, 255, cv2.FILLED), np.uint8)

    def _outset_mm(self, compression_mm: float) -> float:
        """Distance of the visible edge outside the contact's, from the steep part of the contact's edge."""
        mask = (self._seen(self._gap) < compression_mm).astype(np.uint8)
        edge = cv2.dilate(mask, np.ones((3, 3), np.uint8)) > mask
        if not edge.any():
            return 0.0
        slope = float(np.quantile(self._edge_slope[edge], _STEEP_QUANTILE))
        return min(_OUTSET_MOST_MM, _OUTSET_MM * max(0.0, slope - _OUTSET_SLOPE))
