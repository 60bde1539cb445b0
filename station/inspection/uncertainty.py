"""The uncertainty of an area against its limit as a budget, after the GUM (JCGM 100:2008), and the guard band from it.

Every component is a standard uncertainty of one input, with the factor by which it changes the area (the sensitivity);
they are independent, so their shares of the area add by their squares (GUM 5.1.2).
"""

from dataclasses import dataclass
from math import hypot, sqrt

from station.inspection.press import Press
from station.inspection.sized_limits import SizedLimits

COMPONENTS = {
    "repeatability": "repeatability of the area",
    "onset": "onset between two images",
    "gripper": "resolution of the gripper",
    "scale": "scale of the unit",
    "size": "length of the fruit",
}
"""What each component is, in the order of the budget's table."""


@dataclass(frozen=True, slots=True)
class Component:
    """One input's part of the uncertainty."""

    name: str
    standard: float
    """Standard uncertainty of the input, in `unit`."""
    unit: str
    """`mm`, or empty for a share."""
    sensitivity: float
    """By which share the area, or its limit, changes for one unit of the input."""

    @property
    def relative(self) -> float:
        """Standard uncertainty as a share of the area."""
        return self.sensitivity * self.standard


@dataclass(frozen=True, slots=True)
class Budget:
    """All components at one closing."""

    closing_mm: float
    components: tuple[Component, ...]
    """One for each of `COMPONENTS`."""
    factor: float
    """The coverage factor, one-sided."""

    @property
    def combined(self) -> float:
        """Combined standard uncertainty, as a share of the area."""
        return hypot(*(each.relative for each in self.components))

    @property
    def expanded(self) -> float:
        """The guard band, as a share of the area."""
        return self.factor * self.combined

    def expanded_of(self, *names: str) -> float:
        """Return the expanded uncertainty that some of `COMPONENTS` alone would give, as a share of the area."""
        return self.factor * hypot(*(each.relative for each in self.components if each.name in names))


def budget_at(closing_mm: float, press: Press, limits: SizedLimits) -> Budget:
    """The budget of an area at a closing above 0."""
    rule = limits.recipe.damage.uncertainty
    # Hertz's contact: the area goes as the closing, so an error of the closing is the same share of the area.
    per_mm = 1 / closing_mm
    components = (
        Component("repeatability", rule.repeatability_at(closing_mm), "", 1.0),
        # The contact began anywhere between the last image without it and the first with it: rectangular. Limits are
        # found with onsets as late as others, so that its middle is in both.
        # Where the onset's uncertainty is None the press is void, and its budget decides nothing.
        Component("onset", rectangular(press.onset_uncertainty_mm or 0.0), "mm", per_mm),
        Component("gripper", rectangular(press.resolution_mm), "mm", per_mm),
        # An area has the scale twice.
        Component("scale", press.scale_uncertainty, "", 2.0),
        Component("size", limits.relative_uncertainty, "", 1.0),
    )
    return Budget(closing_mm, components, rule.factor)


def rectangular(width: float) -> float:
    """The standard uncertainty of a rectangular distribution of this width (GUM 4.3.7)."""
    return width / sqrt(12)
