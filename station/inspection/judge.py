"""The judge: a press and its recipe → PASS, FAIL or NO_RESULT, with every reason in a sentence."""

from dataclasses import dataclass

from station.inspection.press import Measured, Press
from station.settings.recipe_model import Recipe
from station.vocabulary import OutcomeName, Reason


@dataclass(frozen=True, slots=True)
class Finding:
    """One reason against PASS."""

    reason: Reason
    sentence: str
    """For the quality manager: the value, its limit and the closing."""
    proves: bool
    """It alone proves the fruit damaged; else it keeps the measurement from being trusted."""
    value: float | None = None
    limit: float | None = None
    closing_mm: float | None = None


@dataclass(frozen=True, slots=True)
class AreaAt:
    """The area at one of the recipe's results' closings, interpolated between measured points."""

    closing_mm: float
    area_mm2: float | None
    """None where the closing was not reached; nothing is extrapolated."""
    uncertainty_mm2: float | None
    limit_mm2: float | None
    """None where the recipe has no damage threshold here."""


@dataclass(frozen=True, slots=True)
class Growth:
    """The steepest growth of the area over a few steps."""

    mm2_per_mm: float
    uncertainty_mm2_per_mm: float
    from_closing_mm: float
    to_closing_mm: float


@dataclass(frozen=True, slots=True)
class Verdict:
    """The judgement of one press."""

    outcome: OutcomeName
    findings: tuple[Finding, ...]
    """In the order of the reasons; empty just for PASS."""
    deciding: Measured | None
    """The measured point that decided, or the last with an area; None where nothing valid was measured."""
    areas: tuple[AreaAt, ...]
    growth: Growth | None
    """None with fewer than two points in contact."""
    partial: bool
    """Ended before the recipe's last step."""

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Each once, in the order of their bits."""
        found = {finding.reason for finding in self.findings}
        return tuple(reason for reason in Reason if reason in found)


def judge(press: Press, recipe: Recipe) -> Verdict:
    """Judge a press.

    Args:
        press: all measured points, in any order.
        recipe: limits and expectations.
    """
    raise NotImplementedError


def early_stop(press: Press, recipe: Recipe) -> Finding | None:
    """Whether no further step is to be made, to spare fruit and gel.

    Args:
        press: what was measured so far.
        recipe: its early stop's limits and its closing limit.

    Returns:
        Why, with reason `EARLY_STOP`; None where the next step may be made.
    """
    raise NotImplementedError
