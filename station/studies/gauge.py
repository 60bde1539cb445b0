"""Gauge repeatability and reproducibility: the crossed analysis of variance of AIAG's MSA.

Source: Automotive Industry Action Group, Measurement Systems Analysis, 4th edition (2010), chapter III, section B,
"Analysis of Variance (ANOVA) method", and its appendix A.
"""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc

POOLED_FROM = 0.25
"""An interaction of weaker significance is pooled with the equipment's."""
SPREAD = 6.0
"""Standard deviations in a variation's span, compared with the tolerance; 99.73 % of a normal distribution."""
_ROUNDING = 1e-12
"""Share of the largest value: a smaller difference of means is the computer's rounding (2e-16 of a value), not a
variation. The variation of identical repeats is 0 for any values."""


@dataclass(frozen=True, slots=True)
class Source:
    """One row of the analysis of variance."""

    name: str
    sum_of_squares: float
    degrees: int
    f: float | None = None
    """None if the source is not tested, and where it varies and what it is tested against does not: infinite."""
    p: float | None = None
    """Significance; None if the source is not tested."""

    @property
    def mean_square(self) -> float:
        """Sum of squares over degrees of freedom."""
        return self.sum_of_squares / self.degrees


@dataclass(frozen=True, slots=True)
class Component:
    """One kind of variation."""

    name: str
    sigma: float
    """Standard deviation, in the measurement's unit."""
    study_percent: float
    """Of the total variation; the components' squares add up, not the components."""
    contribution_percent: float
    """Of the total variance."""
    tolerance_percent: float | None
    """Six of its standard deviations over the tolerance; None without one."""


@dataclass(frozen=True, slots=True)
class Gauge:
    """Result of a gauge study."""

    sources: tuple[Source, ...]
    pooled: bool
    """The interaction was pooled with the equipment's variation."""
    components: tuple[Component, ...]
    """Named EV, AV, INT (if not pooled), GRR, PV and TV."""
    distinct_categories: int | None
    """ndc; at least 5 are required. None if parts differ and nothing else does: it has no limit."""
    tolerance: float | None

    def component(self, name: str) -> Component:
        """Return one component by its name: EV, AV, INT, GRR, PV or TV.

        Raises:
            KeyError: there is none of that name.
        """
        return {component.name: component for component in self.components}[name]


def analyse(values: npt.ArrayLike, tolerance: float | None = None) -> Gauge:
    """Split the variation of a balanced crossed study.

    Args:
        values: shape (parts, operators, repeats), each side at least 2, finite.
        tolerance: width of the tolerance, in the values' unit.

    Raises:
        ValueError: the shape is not that, a value is not finite, or the tolerance is not positive.
    """
    table = np.asarray(values, float)
    if table.ndim != 3 or min(table.shape) < 2 or not np.isfinite(table).all():
        raise ValueError(f"expected finite values of at least 2 parts x 2 operators x 2 repeats, got {table.shape}")
    if tolerance is not None and not tolerance > 0:
        raise ValueError(f"expected a tolerance above 0, got {tolerance}")
    parts, operators, repeats = table.shape
    sources, pooled = _variance(table)
    by_name = {source.name: source.mean_square for source in sources}
    within = by_name["equipment"]
    against = within if pooled else by_name["interaction"]
    # AV, INT and PV are differences of mean squares, which chance may make negative: then they are 0.
    variances = {
        "EV": within,
        "AV": max(0.0, (by_name["operators"] - against) / (parts * repeats)),
        "INT": 0.0 if pooled else max(0.0, (by_name["interaction"] - within) / repeats),
        "PV": max(0.0, (by_name["parts"] - against) / (operators * repeats)),
    }
    variances["GRR"] = variances["EV"] + variances["AV"] + variances["INT"]
    variances["TV"] = variances["GRR"] + variances["PV"]
    total = sqrt(variances["TV"])
    shown = ["EV", "AV", *([] if pooled else ["INT"]), "GRR", "PV", "TV"]
    components = tuple(
        Component(
            name,
            sqrt(variances[name]),
            100 * sqrt(variances[name]) / total if total else 0.0,
            100 * variances[name] / total**2 if total else 0.0,
            None if tolerance is None else 100 * SPREAD * sqrt(variances[name]) / tolerance,
        )
        for name in shown
    )
    grr, between = sqrt(variances["GRR"]), sqrt(variances["PV"])
    # AIAG's ndc, with its rounded root of 2.
    categories = int(1.41 * between / grr) if grr else None if between else 0
    return Gauge(sources, pooled, components, categories, tolerance)


def _variance(table: npt.NDArray[np.float64]) -> tuple[tuple[Source, ...], bool]:
    """Compute the analysis of variance, with the interaction pooled if it is not significant."""
    parts, operators, repeats = table.shape
    mean = table.mean()
    of_parts, of_operators = table.mean(axis=(1, 2)), table.mean(axis=(0, 2))
    cells = table.mean(axis=2)
    rounding = _ROUNDING * float(np.abs(table).max())
    between_parts = operators * repeats * _sum_of_squares(of_parts - mean, rounding)
    between_operators = parts * repeats * _sum_of_squares(of_operators - mean, rounding)
    crossed = cells - of_parts[:, None] - of_operators[None, :] + mean
    interaction = repeats * _sum_of_squares(crossed, rounding)
    within = _sum_of_squares(table - cells[..., None], rounding)
    crossed_degrees, within_degrees = (parts - 1) * (operators - 1), parts * operators * (repeats - 1)
    tested = _tested(Source("interaction", interaction, crossed_degrees), Source("", within, within_degrees))
    pooled = tested.p is None or tested.p > POOLED_FROM
    equipment = (
        Source("equipment", interaction + within, crossed_degrees + within_degrees)
        if pooled
        else Source("equipment", within, within_degrees)
    )
    against = equipment if pooled else tested
    sources = [
        _tested(Source("parts", between_parts, parts - 1), against),
        _tested(Source("operators", between_operators, operators - 1), against),
        tested,
        equipment,
    ]
    return tuple(sources), pooled


def _sum_of_squares(differences: npt.NDArray[np.float64], rounding: float) -> float:
    return float(np.square(np.where(np.abs(differences) > rounding, differences, 0.0)).sum())


def _tested(source: Source, against: Source) -> Source:
    """Return a source with its F and significance; without them where neither of the two varies."""
    if against.mean_square > 0:
        f = source.mean_square / against.mean_square
        return replace(source, f=f, p=float(fdtrc(source.degrees, against.degrees, f)))
    return replace(source, p=0.0) if source.mean_square > 0 else source
