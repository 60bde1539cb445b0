"""Soft bodies that the twin presses on the gel, drawn from a seed: balls, foam, fruit, rings, rods.

Every range in this file is an estimate unless a source is named. Radii, pitches and rim widths are those of the
bodies that real sensors were pressed on; stiffnesses are chosen so that the drawn dents are as shallow as the
real ones appeared.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from station.twin.gel import FloatArray

from .shape import ellipsoid_gap_mm, ring_gap_mm, rod_gap_mm
from .skin import Skin


class SoftKind(StrEnum):
    """Kinds of bodies, beside the fruit of `station.twin.fruit`."""

    SOFT_BALL = "soft_ball"
    FOAM = "foam"
    COARSE_FRUIT = "coarse_fruit"
    """Orange, mandarin, kiwi."""
    SMOOTH_FRUIT = "smooth_fruit"
    """Tomato, plum, grape."""
    RING = "ring"
    """An O-ring, a cup's mouth, a ring whose inside is recessed."""
    LONG = "long"
    """A stem, a cylinder, a finger, which crosses the field or ends in it."""


@dataclass(frozen=True, slots=True)
class Foundation:
    """A body's surface as a bed of springs beside each other that yield: soft bodies press with an even pressure.

    A foam's walls buckle at a plateau stress and a ball's or a fruit's inner pressure is the same everywhere
    (Gibson and Ashby, Cellular Solids, 1997, chapter 5, for the foam's curve).
    """

    plateau_mpa: float
    knee_mm: float
    """Flattening at which the pressure has come to 63 % of the plateau."""
    hardening_per_mm: float
    """Further rise of the pressure for each mm of flattening, over the plateau."""

    def pressure_mpa(self, flattened_mm: FloatArray) -> FloatArray:
        """Pressure of the body's springs, MPa.

        Args:
            flattened_mm: the part of the overlap by which the body gives way, any shape, not negative.
        """
        rising = -np.expm1(-flattened_mm / np.float32(self.knee_mm)) + self.hardening_per_mm * flattened_mm
        return (self.plateau_mpa * rising).astype(np.float32)


@dataclass(frozen=True, slots=True)
class SoftBody:
    """One body, its foremost point in the middle; a rod's length is along y."""

    kind: SoftKind
    seed: int
    radii_mm: tuple[float, float]
    """Radii of curvature across and along; a ring's middle line and flank; a rod's radius, twice."""
    foundation: Foundation
    skin: Skin = Skin.SMOOTH
    pitch_mm: float = 1.0
    """Of the skin's relief."""
    relief_mm: float = 0.0
    """Standard deviation of the relief where it is pressed in fully."""
    full_imprint_mpa: float = 0.1
    """Pressure at which the relief is pressed in fully."""
    wave_mm: float = 0.0
    """Standard deviation of the body's wide unevenness."""
    rim_flat_mm: float = 0.0
    """A ring's: half width of the rim's flat top."""
    recess_mm: float = 0.0
    """A ring's: distance of its inside behind its rim."""
    end_mm: float = np.inf
    """A rod's: where its end is, along y from the middle."""
    bend_per_mm: float = 0.0
    """A rod's: curvature of its axis."""

    def gap_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Distance of the body's surface behind its foremost point.

        Args:
            x_mm: across the body, any shape.
            y_mm: along it, shape as `x_mm`.
        """
        match self.kind:
            case SoftKind.RING:
                middle_mm, flank_mm = self.radii_mm
                return ring_gap_mm(np.hypot(x_mm, y_mm), middle_mm, (self.rim_flat_mm, flank_mm), self.recess_mm)
            case SoftKind.LONG:
                return rod_gap_mm(x_mm, y_mm, self.radii_mm[0], self.end_mm, self.bend_per_mm)
            case _:
                return ellipsoid_gap_mm(x_mm, y_mm, self.radii_mm)


def draw_soft_body(kind: SoftKind | str, seed: int) -> SoftBody:
    """Draw a body.

    Args:
        kind: what to draw.
        seed: the same seed gives the same body.

    Raises:
        ValueError: there is no such kind.
    """
    kind = SoftKind(kind)
    generator = np.random.default_rng([seed, 10, list(SoftKind).index(kind)])
    return _DRAWN[kind](seed, generator)


def _log_uniform(generator: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _soft_ball(seed: int, generator: np.random.Generator) -> SoftBody:
    radius_mm = _log_uniform(generator, 12.0, 40.0)
    foundation = Foundation(
        _log_uniform(generator, 0.013, 0.07), _log_uniform(generator, 0.05, 0.35), generator.uniform(0.05, 0.3)
    )
    return SoftBody(SoftKind.SOFT_BALL, seed, (radius_mm, radius_mm), foundation, wave_mm=generator.uniform(0.0, 0.02))


def _foam(seed: int, generator: np.random.Generator) -> SoftBody:
    radius_mm = _log_uniform(generator, 15.0, 50.0)
    foundation = Foundation(
        _log_uniform(generator, 0.006, 0.03), _log_uniform(generator, 0.1, 0.5), generator.uniform(0.1, 0.5)
    )
    return SoftBody(
        SoftKind.FOAM, seed, (radius_mm, radius_mm * generator.uniform(1.0, 2.0)), foundation,
        skin=Skin.ROUGH, pitch_mm=generator.uniform(0.4, 0.9), relief_mm=_log_uniform(generator, 0.004, 0.016),
        full_imprint_mpa=1.5 * foundation.plateau_mpa, wave_mm=generator.uniform(0.0, 0.06),
    )  # fmt: skip


def _coarse_fruit(seed: int, generator: np.random.Generator) -> SoftBody:
    radius_mm = _log_uniform(generator, 18.0, 45.0)
    foundation = Foundation(
        _log_uniform(generator, 0.03, 0.13), _log_uniform(generator, 0.05, 0.35), generator.uniform(0.1, 0.4)
    )
    skin = Skin.PITTED if generator.random() < 0.7 else Skin.ROUGH
    return SoftBody(
        SoftKind.COARSE_FRUIT, seed, (radius_mm, radius_mm * generator.uniform(0.9, 1.3)), foundation,
        skin=skin, pitch_mm=generator.uniform(0.9, 1.9), relief_mm=_log_uniform(generator, 0.012, 0.045),
        full_imprint_mpa=1.3 * foundation.plateau_mpa, wave_mm=generator.uniform(0.01, 0.06),
    )  # fmt: skip


def _smooth_fruit(seed: int, generator: np.random.Generator) -> SoftBody:
    radius_mm = _log_uniform(generator, 12.0, 40.0)
    foundation = Foundation(
        _log_uniform(generator, 0.03, 0.13), _log_uniform(generator, 0.05, 0.35), generator.uniform(0.1, 0.4)
    )
    return SoftBody(
        SoftKind.SMOOTH_FRUIT, seed, (radius_mm, radius_mm * generator.uniform(0.9, 1.6)), foundation,
        skin=Skin.ROUGH, pitch_mm=generator.uniform(0.8, 2.0), relief_mm=_log_uniform(generator, 0.0005, 0.004),
        full_imprint_mpa=1.3 * foundation.plateau_mpa, wave_mm=generator.uniform(0.0, 0.04),
    )  # fmt: skip


def _ring(seed: int, generator: np.random.Generator) -> SoftBody:
    width_mm, outer_mm = generator.uniform(1.0, 2.0), generator.uniform(5.0, 9.0)
    flat_mm = generator.uniform(0.0, 0.3) * width_mm
    foundation = Foundation(_log_uniform(generator, 0.3, 2.0), generator.uniform(0.5, 1.0), 1.0)
    # Two in three are open rings; the others' inside is a shallow floor that a firm press reaches.
    recess_mm = 3.0 if generator.random() < 0.67 else generator.uniform(0.25, 0.7)
    return SoftBody(
        SoftKind.RING, seed, ((outer_mm - width_mm) / 2, width_mm / 2 - flat_mm * 0.8), foundation,
        rim_flat_mm=flat_mm, recess_mm=recess_mm,
    )  # fmt: skip


def _long(seed: int, generator: np.random.Generator) -> SoftBody:
    radius_mm = _log_uniform(generator, 1.0, 8.0)
    foundation = Foundation(_log_uniform(generator, 0.05, 1.0), generator.uniform(0.3, 1.0), 0.5)
    end_mm = np.inf if generator.random() < 0.5 else generator.uniform(-3.0, 3.0)
    return SoftBody(
        SoftKind.LONG, seed, (radius_mm, radius_mm), foundation,
        skin=Skin.ROUGH, pitch_mm=generator.uniform(0.6, 1.5), relief_mm=_log_uniform(generator, 0.0005, 0.01),
        full_imprint_mpa=foundation.plateau_mpa, end_mm=end_mm, bend_per_mm=generator.uniform(-0.02, 0.02),
    )  # fmt: skip


_DRAWN = {
    SoftKind.SOFT_BALL: _soft_ball,
    SoftKind.FOAM: _foam,
    SoftKind.COARSE_FRUIT: _coarse_fruit,
    SoftKind.SMOOTH_FRUIT: _smooth_fruit,
    SoftKind.RING: _ring,
    SoftKind.LONG: _long,
}
