"""The fruit that the twin has squeezed: size, shape, texture, stiffness, creep and yield, drawn from a seed."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from station.twin.damage import DAMAGES, NO_DAMAGE, Damage, Severity
from station.twin.gel import FloatArray, Surface
from station.twin.texture import Texture, achenes, calyx, drupelets, smooth


class Kind(StrEnum):
    """Kind of fruit, or of ball, between the fingers."""

    STRAWBERRY = "strawberry"
    RASPBERRY = "raspberry"
    BLUEBERRY = "blueberry"
    RUBBER_BALL = "rubber_ball"
    TEST_SPHERE = "test_sphere"


@dataclass(frozen=True, slots=True)
class Variety:
    """Distribution of the fruit of a kind, and the properties of their flesh, shape and skin."""

    mean: tuple[float, float, float]
    """Weight g, length mm, width mm."""
    spread: tuple[float, float, float]
    """Standard deviations of the same."""
    correlation: tuple[float, float, float]
    """Weight with length, weight with width, length with width."""
    modulus_mpa: float
    poisson: float
    modulus_spread: float
    """Standard deviation of the modulus' logarithm; blueberry cultivars differ by 2.4 from softest to firmest."""
    creep: float
    """Share of the stiffness that is lost when a squeeze is held for ever."""
    retardation_s: tuple[float, float]
    yield_n: float
    """Force beyond which the flesh is damaged; an estimate, no source found."""
    taper: float
    """0 an ellipsoid, towards 1 a cone along the length."""
    texture: Texture


# Sizes: mean, sample standard deviation and correlation of the 30 fruit of each kind listed in Computers and
# Electronics in Agriculture 235 (2025) 110397. Moduli: strawberry, raspberry and rubber within the published
# ranges of flesh (0.05 to 1 MPa); the blueberry's gives the mean firmness 1.34 N/mm of 88 cultivars between plates.
VARIETIES = {
    Kind.STRAWBERRY: Variety(
        (24.54, 45.40, 35.21), (8.84, 7.88, 5.19), (0.81, 0.73, 0.42),
        0.45, 0.45, 0.20, 0.30, (11.0, 141.0), 14.0, 0.35, achenes,
    ),
    Kind.RASPBERRY: Variety(
        (5.67, 23.85, 22.71), (1.16, 2.53, 2.08), (0.81, 0.84, 0.58),
        0.20, 0.45, 0.20, 0.35, (8.0, 60.0), 4.0, 0.25, drupelets,
    ),
    Kind.BLUEBERRY: Variety(
        (1.95, 15.94, 15.80), (0.29, 0.96, 0.86), (0.75, 0.72, 0.79),
        0.75, 0.45, 0.20, 0.15, (10.0, 60.0), 9.0, 0.0, calyx,
    ),
    Kind.RUBBER_BALL: Variety(
        (8.0, 24.0, 24.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0),
        1.5, 0.49, 0.0, 0.02, (5.0, 5.0), 1e6, 0.0, smooth,
    ),
    # Steel, rigid beside the gel. It does not creep: its retardation is a divisor that must not be 0.
    Kind.TEST_SPHERE: Variety(
        (0.9, 6.0, 6.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0),
        2e5, 0.3, 0.0, 0.0, (1.0, 1.0), 1e9, 0.0, smooth,
    ),
}  # fmt: skip

_TAIL = 2.4
"""Fruit beyond this many standard deviations is drawn again: graders have taken it out."""


@dataclass(frozen=True, slots=True)
class Fruit:
    """One fruit. It is gripped along its width; its length lies along the image's rows."""

    kind: Kind
    weight_g: float
    length_mm: float
    width_mm: float
    modulus_mpa: float
    retardation_s: float
    seed: int
    bruised: bool = False
    damage: Damage = DAMAGES[Severity.SEVERE]
    """What a bruise of it is; of no effect where it is sound."""

    @property
    def variety(self) -> Variety:
        """Properties that all fruit of the kind share."""
        return VARIETIES[self.kind]

    @property
    def half_axes_mm(self) -> tuple[float, float]:
        """Half axes of the ellipsoid across the gripped one: along the columns, along the rows."""
        # The mean radius goes with the product of both half axes, so that each has the root of the factor.
        flat = np.sqrt(self._damage.flattening)
        return self.width_mm / 2 * flat, self.length_mm / 2 * flat

    @property
    def surface(self) -> Surface:
        """The curvature where the gel touches."""
        across_mm, along_mm = self.half_axes_mm
        # The geometric mean of the principal radii across²/depth and along²/depth.
        return Surface(self.width_mm / 2, across_mm * along_mm / (self.width_mm / 2))

    @property
    def contact_modulus_mpa(self) -> float:
        """Young's modulus of the flesh under the gel, softer where it is bruised."""
        return self.modulus_mpa * self._damage.softening

    def contact_softening(self, contact_radius_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """By how much a soft patch under the gel lowers the contact's modulus further, 1 for not at all.

        Compliances are averaged by the load over them: a contact within the patch is as soft as the patch, one much
        wider as hard as the fruit. An estimate; the contact's outline stays the fruit's.

        Args:
            contact_radius_mm: of the contact, any shape.
        """
        if self._damage.patch is None:
            return np.ones_like(contact_radius_mm)
        share = self._damage.patch.load_share(contact_radius_mm)
        return 1.0 / (1.0 - share + share / self._damage.patch.softening)

    @property
    def _damage(self) -> Damage:
        return self.damage if self.bruised else NO_DAMAGE

    def gap_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Return the distance of the smoothed surface behind the foremost point, mm.

        Args:
            x_mm: across the fruit from the foremost point, any shape.
            y_mm: along it, shape as `x_mm`; positive towards a tapered fruit's tip.
        """
        across_mm, along_mm = self.half_axes_mm
        relative_y = y_mm / np.float32(along_mm)
        narrowed = 1.0 + self.variety.taper * np.clip(relative_y, -1.0, 1.0)
        relative_squared = np.square(x_mm / np.float32(across_mm)) * narrowed + np.square(relative_y) * np.where(
            relative_y > 0, narrowed, 1.0
        )
        return self.surface.gap_mm(relative_squared.astype(np.float32))

    def texture_mm(self, x_mm: FloatArray, y_mm: FloatArray) -> FloatArray:
        """Return the skin's depth below its highest points, mm: pits, seeds, drupelets, calyx. Args as for `gap_mm`."""
        # The second number separates the random streams of one seed: 0 draws size and stiffness, 1 the skin.
        return self.variety.texture(x_mm, y_mm, np.random.default_rng([self.seed, 1]))


def draw_fruit(
    kind: Kind | str, seed: int, *, bruised: bool = False, damage: Damage = DAMAGES[Severity.SEVERE]
) -> Fruit:
    """Draw a fruit: sizes with the published mean, spread and correlation, stiffness log-normal.

    Args:
        seed: the same seed gives the same fruit.
        bruised: damage it where the gel touches.
        damage: how, where it is bruised.

    Raises:
        ValueError: there is no such kind.
    """
    kind = Kind(kind)
    variety = VARIETIES[kind]
    generator = np.random.default_rng([seed, 0])
    weight_g, length_mm, width_mm = _draw_size(variety, generator)
    modulus_mpa = variety.modulus_mpa * float(np.exp(variety.modulus_spread * generator.standard_normal()))
    retardation_s = float(np.exp(generator.uniform(*np.log(variety.retardation_s))))
    return Fruit(kind, weight_g, length_mm, width_mm, modulus_mpa, retardation_s, seed, bruised, damage)


def _draw_size(variety: Variety, generator: np.random.Generator) -> npt.NDArray[np.float64]:
    """Correlated normal sizes; the spread is widened by what cutting the tails takes away."""
    with_length, with_width, length_width = variety.correlation
    correlation = np.array(
        [[1, with_length, with_width], [with_length, 1, length_width], [with_width, length_width, 1]]
    )
    factor = np.linalg.cholesky(correlation)
    while True:
        deviates = factor @ generator.standard_normal(3) * 1.04
        if np.all(np.abs(deviates) < _TAIL):
            return np.asarray(variety.mean) + deviates * np.asarray(variety.spread)
