"""A fruit squeezed between the gel and the sponge on the other finger: how the closing is shared, and the force.

In series: the gel and the fruit's front in one Hertz contact whose compliances add (Johnson, Contact Mechanics,
equation 4.22), the fruit's back in the sponge, and the sponge itself, a foam that stiffens as it is pressed flat.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from station.twin.fruit import Fruit
from station.twin.gel import Gel

_SPONGE_N_PER_MM = 2.0
_SPONGE_FLAT_MM = 6.0
_FREE_DENT, _DEEPEST_DENT = 0.55, 0.8
"""Of the gel's thickness: from where its dent bends off, and where it ends; the fruit flattens instead."""
_SAMPLES = 600


@dataclass(frozen=True, slots=True)
class Squeezed:
    """State of a squeezed fruit at one closing: the force, and the approach with the gel's part of it."""

    closing_mm: float
    force_n: float
    approach_mm: float
    """Of the fruit's front and the gel's surface together."""
    dent_mm: float
    """The gel's part of that approach."""

    @property
    def gel_share(self) -> float:
        """The gel's part of the approach as a fraction, 0 to 1."""
        return self.dent_mm / self.approach_mm if self.approach_mm > 0 else 0.0


class Squeeze:
    """The curve of one fruit, made once and read for any closing; force and approach never fall as it closes."""

    def __init__(self, fruit: Fruit, gel: Gel, held_s: float = 0.0) -> None:
        variety = fruit.variety
        self._radius_mm = fruit.surface.radius_mm
        relaxed = 1.0 - variety.creep * (1.0 - np.exp(-held_s / fruit.retardation_s))
        plane = 1.0 - variety.poisson**2
        approach = np.linspace(0.0, 0.45 * fruit.width_mm, _SAMPLES)
        # The contact's radius follows from the whole approach, independent of how the two bodies share it.
        gel_compliance = (1.0 - gel.poisson**2) / (gel.modulus_mpa * gel.stiffening(approach, self._radius_mm))
        softening = fruit.contact_softening(np.sqrt(approach * self._radius_mm))
        front_compliance = plane / (fruit.contact_modulus_mpa * softening * relaxed)
        compliance = gel_compliance + front_compliance
        force = 4.0 / 3.0 / compliance * np.sqrt(self._radius_mm) * approach**1.5
        # Where the contact grows onto a soft patch the mean modulus falls; the force that was reached stays.
        force = np.maximum.accumulate(force)
        # The damage is on the gel's side alone: the back is sound flesh.
        back_modulus_mpa = fruit.modulus_mpa * relaxed / plane
        back = 0.5 * (0.75 * force / (back_modulus_mpa * np.sqrt(self._radius_mm))) ** (2 / 3)
        pressed = np.linspace(0.0, 10.0 * _SPONGE_FLAT_MM, _SAMPLES)
        # The sponge's law has no simple inverse: it is tabulated, and read backwards.
        sponge = np.interp(force, _SPONGE_N_PER_MM * pressed * (1.0 + (pressed / _SPONGE_FLAT_MM) ** 3), pressed)
        self._approach, self._force = approach, force
        self._dent = _limited(approach * gel_compliance / compliance, gel.thickness_mm)
        self._closing = approach + back + sponge

    def at(self, closing_mm: float) -> Squeezed:
        """Return the state at a closing, mm since first contact; zero before it, at most that of the crushed fruit."""
        closing = max(0.0, closing_mm)
        approach = float(np.interp(closing, self._closing, self._approach))
        return Squeezed(
            closing_mm,
            float(np.interp(closing, self._closing, self._force)),
            approach,
            float(np.interp(approach, self._approach, self._dent)),
        )


def _limited(dent: npt.NDArray[np.float64], thickness_mm: float) -> npt.NDArray[np.float64]:
    """Bend a dent off towards the deepest that the gel's thickness allows."""
    free, room = _FREE_DENT * thickness_mm, (_DEEPEST_DENT - _FREE_DENT) * thickness_mm
    # tanh begins with a slope of 1, so that the curve bends off without a kink.
    return np.where(dent > free, free + room * np.tanh((dent - free) / room), dent)
