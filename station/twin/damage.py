"""Damage of a simulated fruit where the gel touches it: softer, flatter, or a soft patch, by named severity."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class SoftPatch:
    """A round place of softer flesh on the side of the gel; the fruit keeps its shape there."""

    radius_mm: float
    softening: float
    """Share of the flesh's modulus that is left in it."""
    x_mm: float = 0.0
    """Across the fruit, from its foremost point to the patch's middle."""
    y_mm: float = 0.0
    """Along it, towards the tip."""

    def load_share(self, contact_radius_mm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The share of a Hertz contact's load that lies over the patch, 0 to 1.

        Args:
            contact_radius_mm: of the contact, which is centred on the foremost point; any shape.
        """
        rings, spokes = np.meshgrid((np.arange(_RINGS) + 0.5) / _RINGS, np.arange(_SPOKES) * 2.0 * np.pi / _SPOKES)
        # Hertz's pressure is p0 (1 - r²/a²)^(1/2), so 1 - (1 - r²/a²)^(3/2) of the load lies within r: each sample
        # below carries the same load.
        radius = np.sqrt(1.0 - (1.0 - rings.ravel()) ** (2 / 3))
        x, y = radius * np.cos(spokes.ravel()), radius * np.sin(spokes.ravel())
        a = np.asarray(contact_radius_mm, float)[..., None]
        return np.mean(np.hypot(a * x - self.x_mm, a * y - self.y_mm) < self.radius_mm, axis=-1)


@dataclass(frozen=True, slots=True)
class Damage:
    """Effect of damage on a fruit under the gel: softer flesh, a flatter surface, a soft patch."""

    softening: float = 1.0
    """Share of the flesh's modulus that is left; 1 for sound flesh."""
    flattening: float = 1.0
    """Factor on the mean radius of curvature where the gel touches; 1 for the fruit's own."""
    patch: SoftPatch | None = None


class Severity(StrEnum):
    """The damage that can be selected by name."""

    SEVERE = "severe"
    MILD = "mild"
    PATCH = "patch"


NO_DAMAGE = Damage()
# Softening and flattening are estimates, no source: bruises are published as volumes, not as what a gel feels. The
# patch's radius is that of half a ball of 134 mm³, the largest bruise that impacts left in strawberries (Aliasgarian,
# Ghasemzadeh and Moghaddam, Journal of Agricultural Machinery, Selva and Gavita). On the twin the contact at 3 mm grows
# to 1.65 to 1.75 of a sound fruit's area by the severe damage, 1.3 by the mild one and 1.2 by the patch.
DAMAGES = {
    Severity.SEVERE: Damage(softening=0.45, flattening=1.5),
    Severity.MILD: Damage(softening=0.6, flattening=1.2),
    Severity.PATCH: Damage(patch=SoftPatch(radius_mm=4.0, softening=0.45)),
}

_RINGS, _SPOKES = 24, 32
"""Samples of the contact: the share of load comes in steps of 1/768."""
