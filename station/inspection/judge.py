"""The judge: a press and its recipe → PASS, FAIL or NO_RESULT, with every reason in a sentence.

PASS is said only of a fruit all of whose limits were measured, by trusted points, to be kept with the uncertainty on
top. FAIL needs a trusted proof. All else is NO_RESULT, which the line diverts like FAIL. Why the lines are drawn as
they are: docs/decisions/0015 and 0057.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from station.inspection.evidence import Evidence, Growth
from station.inspection.press import Flag, Measured, Press
from station.inspection.sized_limits import SizedLimits, sized_limits
from station.inspection.uncertainty import Budget
from station.settings.damage import AreaThreshold
from station.settings.recipe_model import Recipe
from station.vocabulary import OutcomeName, Reason


@dataclass(frozen=True, slots=True)
class Finding:
    """One reason against PASS."""

    reason: Reason
    sentence: str
    """For the quality manager: the value, its limit and the closing."""
    value: float | None = None
    limit: float | None = None
    closing_mm: float | None = None
    proves: bool = False
    """It alone proves the fruit damaged; else it keeps the measurement from being trusted."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Why no further step is made."""

    sentence: str
    finding: Finding | None = None
    """The limit that ended the steps, with reason `EARLY_STOP`; None where they ended as the outcome was decided."""


@dataclass(frozen=True, slots=True)
class AreaAt:
    """The area at one of the recipe's results' closings, interpolated between measured points."""

    closing_mm: float
    area_mm2: float | None
    """None where the closing was not reached; nothing is extrapolated."""
    uncertainty_mm2: float | None
    """Expanded: the guard band."""
    limit_mm2: float | None
    """For the fruit's size. None where the recipe has no damage threshold here."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The judgement of one press."""

    outcome: OutcomeName
    findings: tuple[Finding, ...]
    """In the order of the reasons; empty just for PASS. Of FAIL only what proves it, and an early stop."""
    deciding: Measured | None
    """The measured point that decided, or the last trusted one; None where nothing valid was measured."""
    areas: tuple[AreaAt, ...]
    """At each of the recipe's results' closings."""
    growth: Growth | None
    """The steepest over a few steps; None with fewer than two points beyond a light touch."""
    partial: bool
    """A result's closing was not reached; where the steps end when decided, a damage threshold's."""
    stopped: Stop | None
    """Why the steps ended early, also where the fruit passes: what was left is no criterion."""
    limit_factor: float
    """By which the limits for this fruit differ from the recipe's."""
    budget: Budget
    """Of the area at the last damage threshold's closing."""
    summary: str
    """That area with its uncertainty, and the limit for the fruit: a sentence; empty where one of them is not known."""

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Each once, in the order of their bits."""
        found = {finding.reason for finding in self.findings}
        return tuple(reason for reason in Reason if reason in found)


_INTERRUPTED = {
    Reason.REFERENCE_BAD: "The reference images were not usable, so nothing could be compared with them.",
    Reason.IMAGE_STALE: "No image as new as the step came in time.",
    Reason.LATE: "The inspection did not end within its deadline.",
    Reason.CALLED_OFF: "The inspection was called off.",
    Reason.ARM_FAULT: "The arm failed or was stopped during the inspection.",
    Reason.GRIPPER_FAULT: "The gripper failed during the inspection.",
    Reason.CAMERA_FAULT: "The camera failed during the inspection.",
    Reason.RECORDS_FAULT: "The records could not be written.",
    Reason.STATION_LOST: "The station was restarted during the inspection.",
    Reason.INTERNAL_FAULT: "The station's own software failed; its log says where.",
    Reason.NO_CONTACT: "Nothing was touched: no fruit in the nest, or one narrower than the recipe expects.",
}
_DOUBTS = {
    Flag.NO_CONTACT: (Reason.CONTACT_LOST, "the contact was lost"),
    Flag.UNDECIDED: (Reason.LOW_CONFIDENCE, "something bent the gel, but no edge of a contact was found"),
    Flag.CUT_BY_BORDER: (
        Reason.CUT_BY_BORDER,
        "the image's border cuts the contact, so its area is only a lower bound",
    ),
    Flag.LOWER_BOUND: (Reason.LOW_CONFIDENCE, "the edge was lost, so the contact is at least as large as its area"),
    Flag.SATURATED: (Reason.SATURATED, "much of the contact is at the end of the grey scale"),
    Flag.LOW_CONFIDENCE: (Reason.LOW_CONFIDENCE, "the image supports the area too little"),
    Flag.REFERENCE_MISMATCH: (Reason.REFERENCE_BAD, "the image does not fit its reference"),
}
_LATE_START = 0.25
"""Share of the first damage threshold's closing by which the curve may seem to begin after the onset."""


def judge(press: Press, recipe: Recipe) -> Verdict:
    """Judge a press. The same for any order of the points, and for areas and limits in any one unit.

    Args:
        press: all measured points, in any order.
        recipe: limits and expectations.
    """
    case = _Case(press, recipe)
    stopped = case.stopped
    findings = [*case.findings, *([] if case.nothing else _reach(case, stopped))]
    proofs = [finding for finding in findings if finding.proves]
    if proofs and not case.void:
        outcome = "FAIL"
        findings = proofs + ([stopped.finding] if stopped is not None and stopped.finding is not None else [])
    elif case.void or findings:
        outcome, findings = "NO_RESULT", case.void + findings
    else:
        outcome = "PASS"
    recipe, evidence = case.limits.recipe, case.evidence
    areas = tuple(_result(evidence, recipe, closing_mm) for closing_mm in recipe.steps.result_closings_mm)
    last_mm = recipe.damage.area[-1].closing_mm
    if recipe.steps.stop_when_decided:
        partial = evidence.area_at(last_mm) is None
    else:
        partial = areas[-1].area_mm2 is None and not _almost(evidence, recipe)
    order = list(Reason)
    return Verdict(
        outcome=outcome,
        findings=tuple(sorted(findings, key=lambda finding: order.index(finding.reason))),
        deciding=_deciding(evidence, recipe, proofs),
        areas=areas,
        growth=max(evidence.growths, key=lambda growth: growth.mm2_per_mm, default=None),
        partial=partial,
        stopped=stopped,
        limit_factor=case.limits.factor,
        budget=evidence.budget_at(last_mm),
        summary=_summary(case),
    )


def early_stop(press: Press, recipe: Recipe) -> Stop | None:
    """Whether no further step is to be made: to spare fruit and gel, or since nothing could change any more.

    Args:
        press: what was measured so far; also what is not trusted counts.
        recipe: its early stop's limits, its closing limit, and whether it stops when decided.

    Returns:
        Why; None where the next step may be made.
    """
    return _Case(press, recipe).stopped


class _Case:
    """A press beside the limits for its fruit, and what speaks against PASS but for how far the steps went."""

    def __init__(self, press: Press, recipe: Recipe) -> None:
        self.press = press
        self.limits = sized_limits(press, recipe)
        self.evidence = Evidence(press, self.limits)
        self.nothing = press.onset_mm is None
        self.void = [*_void(press, self.limits)]

    @cached_property
    def findings(self) -> list[Finding]:
        """Limits that are or may be passed, and what keeps the measurement from being trusted."""
        if self.nothing:
            return []
        damage = [] if self.limits.problem else _damage(self.evidence, self.limits)
        return [*damage, *_distrust(self.evidence, self.limits.recipe)]

    @cached_property
    def stopped(self) -> Stop | None:
        """Why no further step is made."""
        if not self.evidence.points:
            return None
        if self.limits.recipe.steps.stop_when_decided and (why := self._decided()):
            reached_mm = self.evidence.points[-1].closing_mm
            return Stop(f"No further step was made at {reached_mm:.1f} mm of closing: {why}.")
        finding = _over_early_stop(self.evidence, self.limits.recipe)
        return None if finding is None else Stop(finding.sentence, finding)

    def _decided(self) -> str:
        """Why no further step can change the outcome; empty where one can."""
        if self.void:
            return "this cannot become a result any more"
        if any(finding.proves for finding in self.findings):
            return "the fruit is damaged"
        if self.evidence.points[-1].closing_mm < self.limits.recipe.damage.area[-1].closing_mm:
            return ""
        if not self.findings:
            return "every limit is kept"
        # Only an onset that excused steps hide may show itself, and with one step more.
        lasting = any(finding.reason is not Reason.AREA_NOT_RISING for finding in self.findings)
        beyond = len(self.evidence.judged) - len(self.evidence.needed)
        return "" if self.evidence.excused and not lasting and not beyond else "the fruit cannot pass any more"


def _over_early_stop(evidence: Evidence, recipe: Recipe) -> Finding | None:
    """The recipe's limit that ends the steps, passed also by what is not trusted."""
    points, limits = evidence.points, recipe.early_stop
    last, growth = points[-1], evidence.latest_growth
    place = f"No further step was made at {last.closing_mm:.1f} mm of closing"
    over = max(points, key=lambda point: point.area_mm2)
    if over.area_mm2 > limits.area_mm2:
        told = figure(limits.area_mm2)
        sentence = f"{place}: the area, {over.area_mm2:.1f} mm², is over the early stop's {told} mm²."
        return Finding(Reason.EARLY_STOP, sentence, over.area_mm2, limits.area_mm2, over.closing_mm)
    if growth is not None and growth.mm2_per_mm > limits.growth_mm2_per_mm:
        sentence = (
            f"{place}: the area grows by {growth.mm2_per_mm:.1f} mm² a millimetre, over the early stop's "
            f"{figure(limits.growth_mm2_per_mm)}."
        )
        return Finding(Reason.EARLY_STOP, sentence, growth.mm2_per_mm, limits.growth_mm2_per_mm, growth.to_closing_mm)
    limit_mm = recipe.steps.closing_limit_mm
    if last.closing_mm >= limit_mm:
        sentence = f"{place}: that is the recipe's closing limit of {limit_mm:g} mm."
        return Finding(Reason.EARLY_STOP, sentence, last.closing_mm, limit_mm, last.closing_mm)
    return _hopeless(evidence, recipe, place)


def _hopeless(evidence: Evidence, recipe: Recipe, place: str) -> Finding | None:
    """Past the last damage threshold, whether a PASS is out of reach: then more closing can only hurt the fruit.

    Without this a contact of which only a seed was seen would be pressed up to the gripper's force.
    """
    threshold, last = recipe.damage.area[-1], evidence.points[-1]
    area = evidence.area_at(threshold.closing_mm)
    if last.closing_mm < threshold.closing_mm or area is None:
        return None
    if area[0] - area[1] >= threshold.least_area_mm2 and all(
        evidence.bounds(point) or point in evidence.excused for point in evidence.needed
    ):
        return None
    sentence = f"{place}: what was measured by then cannot be trusted, so the fruit cannot pass any more."
    return Finding(Reason.EARLY_STOP, sentence, area[0], threshold.least_area_mm2, threshold.closing_mm)


def _void(press: Press, limits: SizedLimits) -> Iterator[Finding]:
    """What makes the measurement no measurement of this recipe's fruit: nothing in it is a proof."""
    recipe = limits.recipe
    for reason in dict.fromkeys(press.interruptions):
        yield Finding(reason, _INTERRUPTED.get(reason, f"The inspection was interrupted: {reason}."))
    if press.onset_mm is None:
        if Reason.NO_CONTACT not in press.interruptions:
            yield Finding(Reason.NO_CONTACT, _INTERRUPTED[Reason.NO_CONTACT])
        return
    expected = recipe.expected_width
    if not expected.smallest_mm <= press.onset_mm <= expected.largest_mm:
        beyond = expected.smallest_mm if press.onset_mm < expected.smallest_mm else expected.largest_mm
        sentence = (
            f"The fruit is {press.onset_mm:.1f} mm wide; {recipe.title} is meant for {expected.smallest_mm:g} to "
            f"{expected.largest_mm:g} mm."
        )
        yield Finding(Reason.OUT_OF_RANGE, sentence, press.onset_mm, beyond, 0.0)
    if limits.problem:
        yield Finding(Reason.SIZE_UNKNOWN, limits.problem)


def _damage(evidence: Evidence, limits: SizedLimits) -> Iterator[Finding]:
    """Limits that are passed, or may be."""
    for threshold in limits.recipe.damage.area:
        yield from _area(evidence, threshold, limits)
    limit = limits.recipe.damage.growth_mm2_per_mm
    proofs = [growth for growth in evidence.growths if growth.trusted and growth.least_mm2_per_mm > limit]
    doubts = [growth for growth in evidence.growths if not growth.few and growth.most_mm2_per_mm > limit]
    if not proofs and not doubts:
        return
    worst = max(proofs or doubts, key=lambda growth: growth.mm2_per_mm)
    sentence = (
        f"From {worst.from_closing_mm:.1f} to {worst.to_closing_mm:.1f} mm of closing the area grows by "
        f"{worst.mm2_per_mm:.1f} ± {worst.uncertainty_mm2_per_mm:.1f} mm² a millimetre, "
        f"{'' if proofs else 'which may be '}over the limit of {figure(limit)}."
    )
    reason = Reason.GROWTH_OVER_LIMIT if proofs else Reason.NEAR_LIMIT
    yield Finding(reason, sentence, worst.mm2_per_mm, limit, worst.to_closing_mm, proves=bool(proofs))


def _area(evidence: Evidence, threshold: AreaThreshold, limits: SizedLimits) -> Iterator[Finding]:
    """One area threshold."""
    closing_mm, limit = threshold.closing_mm, threshold.area_mm2
    least, area = evidence.least_area_mm2(closing_mm), evidence.area_at(closing_mm)
    at = f"at {closing_mm:g} mm of closing"
    if least is not None and least > limit:
        sentence = f"The area {at} is at least {least:.1f} mm²; {limit_in_words(limit, limits)}: it is over the limit."
        yield Finding(Reason.AREA_OVER_LIMIT, sentence, least, limit, closing_mm, proves=True)
    elif area is not None and sum(area) > limit:
        told = f"{area[0]:.1f} ± {area[1]:.1f} mm²; {limit_in_words(limit, limits)}"
        sentence = f"The area {at} is {told}: it is not surely within the limit."
        yield Finding(Reason.NEAR_LIMIT, sentence, area[0], limit, closing_mm)
    elif area is not None and area[0] - area[1] < threshold.least_area_mm2:
        sentence = (
            f"The area {at} is {area[0]:.1f} ± {area[1]:.1f} mm², which may be less than any fruit's, "
            f"{figure(threshold.least_area_mm2)} mm²: not all of the contact was seen."
        )
        yield Finding(Reason.LOW_CONFIDENCE, sentence, area[0], threshold.least_area_mm2, closing_mm)


def limit_in_words(limit_mm2: float, limits: SizedLimits) -> str:
    """An area limit with the fruit that it is for, as part of a sentence.

    Args:
        limit_mm2: the limit for the fruit.
        limits: what it was made from.
    """
    told = f"{figure(limit_mm2)} mm²"
    if limits.without_size:
        return f"the limit for a fruit of unknown size is {told}"
    if limits.length_mm is None:
        return f"the limit is {told}"
    fruit = limits.recipe.title.lower()
    if fruit[0] in "aeiou":
        return f"the limit for an {fruit} of {figure(limits.length_mm)} mm is {told}"
    return f"the limit for a {fruit} of {figure(limits.length_mm)} mm is {told}"


def figure(value: float) -> str:
    """A limit as a sentence has it: to a tenth, without a needless `.0`.

    Args:
        value: in its unit.
    """
    return f"{round(value, 1):g}"


def _distrust(evidence: Evidence, recipe: Recipe) -> Iterator[Finding]:
    """What a PASS would need and does not have."""
    for flag, (reason, what) in _DOUBTS.items():
        asked = [point for point in evidence.needed if point not in evidence.excused]
        doubtful = [point for point in asked if flag in evidence.doubts(point)]
        if doubtful:
            worst = min(doubtful, key=lambda point: point.confidence or 0.0)
            places = ", ".join(f"{point.closing_mm:.1f}" for point in doubtful)
            value, limit, told = None, None, ""
            if flag == Flag.LOW_CONFIDENCE:
                value, limit = worst.confidence, recipe.segmentation.robust.least_confidence
                told = "unknown" if value is None else f"{value:.2f}"
                told = f" (confidence {told}, {limit:g} is asked for)"
            yield Finding(reason, f"At {places} mm of closing {what}{told}.", value, limit, worst.closing_mm)
    if falling := [point for point in evidence.falling if point in evidence.needed]:
        places = ", ".join(f"{point.closing_mm:.1f} mm ({point.area_mm2:.1f} mm²)" for point in falling)
        sentence = f"The area does not rise with the closing: {places} does not fit the other steps."
        yield Finding(Reason.AREA_NOT_RISING, sentence, falling[0].area_mm2, None, falling[0].closing_mm)
    yield from _onset(evidence, recipe)


def _onset(evidence: Evidence, recipe: Recipe) -> Iterator[Finding]:
    """Whether the curve begins at the onset: one that was seen too soon makes every area look smaller than it is."""
    begins_mm = evidence.begins_at_mm
    allowed_mm = _LATE_START * recipe.damage.area[0].closing_mm
    if evidence.needed and (begins_mm is None or begins_mm > allowed_mm):
        seen = "does not rise" if begins_mm is None else f"rises as if the contact had begun at {begins_mm:.1f} mm"
        sentence = f"The onset is doubtful: the area {seen}; up to {allowed_mm:g} mm of closing are allowed."
        yield Finding(Reason.AREA_NOT_RISING, sentence, begins_mm, allowed_mm, 0.0)


def _reach(case: _Case, stopped: Stop | None) -> Iterator[Finding]:
    """Whether every damage threshold was reached, and whether the steps ended as they should."""
    evidence, recipe = case.evidence, case.limits.recipe
    missing = [limit for limit in recipe.damage.area if evidence.area_at(limit.closing_mm) is None]
    reached_mm = evidence.points[-1].closing_mm if evidence.points else 0.0
    if stopped is None and (missing or not _almost(evidence, recipe)):
        if case.press.interruptions:  # which say why
            return
        wanted_mm = missing[0].closing_mm if missing else recipe.steps.result_closings_mm[-1]
        sentence = f"The steps ended at {reached_mm:.1f} mm of closing, before {wanted_mm:g} mm, and nothing says why."
        yield Finding(Reason.INTERNAL_FAULT, sentence, reached_mm, wanted_mm, reached_mm)
    elif missing and stopped is not None and stopped.finding is not None:
        sentence = f"{stopped.sentence} The area at {missing[0].closing_mm:g} mm is unknown."
        yield replace(stopped.finding, sentence=sentence)


def _almost(evidence: Evidence, recipe: Recipe) -> bool:
    """Whether the last result's closing was reached but for less than a step: a gripper has counts."""
    reached_mm = evidence.points[-1].closing_mm if evidence.points else 0.0
    return reached_mm > recipe.steps.result_closings_mm[-1] - recipe.steps.step_mm


def _result(evidence: Evidence, recipe: Recipe, closing_mm: float) -> AreaAt:
    area, uncertainty = evidence.area_at(closing_mm) or (None, None)
    limits = [threshold.area_mm2 for threshold in recipe.damage.area if threshold.closing_mm == closing_mm]
    return AreaAt(closing_mm, area, uncertainty, limits[0] if limits else None)


def _summary(case: _Case) -> str:
    threshold, limits = case.limits.recipe.damage.area[-1], case.limits
    area = case.evidence.area_at(threshold.closing_mm)
    if area is None or limits.problem:
        return ""
    told = f"{area[0]:.1f} ± {area[1]:.1f} mm²; {limit_in_words(threshold.area_mm2, limits)}"
    return f"The area at {threshold.closing_mm:g} mm of closing is {told}."


def _deciding(evidence: Evidence, recipe: Recipe, proofs: list[Finding]) -> Measured | None:
    """The trusted point nearest to the first proof, or to the last damage threshold."""
    trusted = [point for point in evidence.judged if evidence.bounds(point)]
    place_mm = proofs[0].closing_mm if proofs else recipe.damage.area[-1].closing_mm
    return min(trusted, key=lambda point: abs(point.closing_mm - (place_mm or 0.0)), default=None)
