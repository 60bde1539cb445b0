"""The DIGIT's gel: how a body pressed into it dents it, and how stiff it answers.

Sources: Hertz's contact of a sphere on a half-space (K. L. Johnson, Contact Mechanics, 1985, section 4.2);
stiffening of a thin layer that is free to slide, Poisson 0.5 (Dimitriadis et al., Biophys. J. 82 (2002) 2798,
equation 13): the softer of its two bounds, since the DIGIT's gel is glued below but free at its sides.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float32]

SENSOR_SHAPE = (640, 480)
"""Rows and columns of the sensor's image, portrait."""
MM_PER_PX = 0.0266
"""Typical for VGA; single units run from 0.0255 to 0.0291."""
GRID_STEP = 2
"""The physics is computed on every second pixel: the gel smooths away what is finer."""
GRID_SHAPE = (SENSOR_SHAPE[0] // GRID_STEP, SENSOR_SHAPE[1] // GRID_STEP)
GRID_MM = MM_PER_PX * GRID_STEP

_STIFFENING = (0.0048, 0.386, 0.781, 0.884, 1.0)
"""Dimitriadis' polynomial in contact radius over thickness, highest power first."""
_SLENDEREST = 1.5
_POLE = 0.98
"""An ellipsoid's gap is its own up to here, in squared half axes; at 1 it would be vertical."""
_OUTSET_MM, _OUTSET_STEEP_MM, _OUTSET_SLOPE = 0.093, 0.8, 0.3
"""How far the visible edge lies outside Hertz's, how much more per slope, and from which slope on."""


@dataclass(frozen=True, slots=True)
class Gel:
    """The gel's size and stiffness; moduli from 0.1 to 0.6 MPa are reported."""

    thickness_mm: float = 2.27
    modulus_mpa: float = 0.12
    poisson: float = 0.48
    outer_reach_mm: float = 4.0
    """Fits the presses of the 6 mm ball best (2.3 to 6 tried)."""
    mm_per_px: float = MM_PER_PX
    """How large the sensor's lens shows it; units differ."""

    def stiffening(self, approach_mm: npt.ArrayLike, radius_mm: float) -> npt.NDArray[np.float64]:
        """Return the layer's stiffness at an approach as a multiple of a half-space's.

        Constant from where the contact's radius is 1.5 times the thickness: the polynomial ends there, and a pad
        hardly wider than the contact bulges at its sides instead.

        Args:
            approach_mm: approach of the two bodies, any shape.
            radius_mm: radius of curvature of the body.
        """
        slenderness = np.sqrt(np.asarray(approach_mm, float) * radius_mm) / self.thickness_mm
        return np.asarray(np.polyval(_STIFFENING, np.minimum(slenderness, _SLENDEREST)), np.float64)

    def outer_share(self, distance_mm: FloatArray) -> FloatArray:
        """Return the share of a half-space's dent that the glued layer has at distances, any shape, beyond the edge."""
        return np.exp(-np.square(distance_mm / np.float32(self.outer_reach_mm)))


def half_space_surface(ratio_squared: FloatArray) -> FloatArray:
    """The dent of a half-space outside a paraboloid's contact, over its approach, at (r/a)² of 1 or more, any shape.

    Johnson's equation 3.42a; at the edge it has the value 1/2 and the slope of the paraboloid.
    """
    angle = np.arcsin(1.0 / np.sqrt(ratio_squared))
    halo = ((2.0 - ratio_squared) * angle + np.sqrt(ratio_squared - 1.0)) / np.float32(np.pi)
    return halo.astype(np.float32)


def visible_edge_mm(contact_radius_mm: float, edge_slope: float) -> float:
    """The radius at which the image's change falls off most steeply, a little outside Hertz's edge.

    That is the edge which people annotate and the station measures. The gel's smoothing puts it outwards by
    3.5 px, and the table's saturation at steep slopes by up to 7 px more; both measured on rendered spheres.

    Args:
        contact_radius_mm: Hertz's radius.
        edge_slope: the dent's slope at that radius, mm per mm.
    """
    return contact_radius_mm + _OUTSET_MM + _OUTSET_STEEP_MM * max(0.0, edge_slope - _OUTSET_SLOPE)


@dataclass(frozen=True, slots=True)
class Surface:
    """A rounded body's curvature: the half axis along which it is pressed, and the mean radius at its tip."""

    depth_mm: float
    radius_mm: float

    def gap_mm(self, relative_squared: FloatArray) -> FloatArray:
        """Return the distance of an ellipsoid's surface behind its foremost point, mm.

        Args:
            relative_squared: (x/a)² + (y/b)² with the half axes across, any shape; beyond the ellipsoid's
                outline the gap goes on growing in proportion.
        """
        # Past the pole the gap grows on instead of ending, so that `relative_squared` can invert it everywhere.
        cut = np.minimum(relative_squared, np.float32(_POLE))
        gap = self.depth_mm * (1.0 - np.sqrt(1.0 - cut) + (relative_squared - cut))
        return gap.astype(np.float32)

    def relative_squared(self, gap_mm: FloatArray) -> FloatArray:
        """The inverse of `gap_mm`: how far out, squared, an ellipsoid has a gap, any shape, not negative."""
        relative_gap = gap_mm / np.float32(self.depth_mm)
        cut = np.minimum(relative_gap, np.float32(1.0 - np.sqrt(1.0 - _POLE)))
        return (1.0 - np.square(1.0 - cut) + (relative_gap - cut)).astype(np.float32)


def dent_mm(gap_mm: FloatArray, approach_mm: float, surface: Surface, gel: Gel) -> FloatArray:
    """The gel's dent under a rigid body whose surface is `gap_mm` behind its foremost point.

    The contact's edge lies where the gap is half the approach: for a paraboloid that is Hertz's a² = R·δ.
    Inside the gel takes the body's shape; outside it follows Hertz's halo over the distance from the edge.

    Args:
        gap_mm: shape (rows, columns), not negative, 0 at the foremost point.
        approach_mm: how far the foremost point has gone beyond first contact; 0 or less gives no dent.
        surface: the body's curvature.

    Returns:
        Shape as `gap_mm`, dtype float32, mm, positive where the gel is pushed in.
    """
    if approach_mm <= 0:
        return np.zeros_like(gap_mm)
    at_edge = surface.relative_squared(np.array([approach_mm / 2], np.float32))[0]
    # At least 1: the halo has no value inside the contact, but is computed for every point.
    outwards_squared = np.maximum(surface.relative_squared(gap_mm) / at_edge, np.float32(1.0))
    contact_radius_mm = np.float32(np.sqrt(approach_mm * surface.radius_mm))
    # An elliptic contact has no single radius: its mean one turns the relative distance into mm.
    beyond_mm = (np.sqrt(outwards_squared) - 1.0) * contact_radius_mm
    halo = np.float32(approach_mm) * half_space_surface(outwards_squared) * gel.outer_share(beyond_mm)
    # At the edge both are half the approach, so that the surface has no step there.
    return np.where(gap_mm < approach_mm / 2, approach_mm - gap_mm, halo).astype(np.float32)
