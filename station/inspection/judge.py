"""The judge: a press and its recipe → PASS, FAIL or NO_RESULT, with a message for every reason.

PASS requires that every limit was measured by trusted points and is met with the uncertainty added. FAIL requires a
trusted proof. Everything else is NO_RESULT, which the line diverts like FAIL. Why the lines are drawn as they are:
docs/decisions/0015 and 0057.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from station.inspection.evidence import LOWER_BOUNDS, Evidence, Growth
from station.inspection.press import Measured, Press
from station.inspection.sized_limits import SizedLimits, sized_limits
from station.inspection.uncertainty import Budget
from station.messages import judge as messages
from station.messages.message import Definition, Message, joined
from station.messages.reasons import reason_message
from station.settings.damage import AreaThreshold
from station.settings.recipe_model import Recipe
from station.vocabulary import Flag, OutcomeName, Reason


@dataclass(frozen=True, slots=True)
class Finding:
    """One reason against PASS."""

    reason: Reason
    message: Message
    """For the quality manager: the value, its limit and the closing."""
    value: float | None = None
    limit: float | None = None
    closing_mm: float | None = None
    proves: bool = False
    """It alone proves the fruit damaged; else it is a reason not to trust the measurement."""


@dataclass(frozen=True, slots=True)
class Stop:
    """Reason to make no further step."""

    message: Message
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
class Judgement:
    """The judgement of one press."""

    outcome: OutcomeName
    findings: tuple[Finding, ...]
    """In the order of the reasons; empty just for PASS. Of FAIL only what proves it, and an early stop."""
    deciding: Measured | None
    """The measured point that decided, or the last trusted one; None where nothing valid was measured."""
    areas: tuple[AreaAt, ...]
    """At each of the recipe's results' closings."""
    growth: Growth | None
    """The steepest over a few steps; None where no two points beyond a light touch are half a count of the gripper
    apart."""
    partial: bool
    """A result's closing was not reached; where the steps end when decided, a damage threshold's."""
    stopped: Stop | None
    """Why the steps ended early, also where the fruit passes: what was left is no criterion."""
    limit_factor: float
    """By which the limits for this fruit differ from the recipe's."""
    budget: Budget
    """Of the area at the last damage threshold's closing."""
    summary: Message | None
    """That area with its uncertainty, and the limit for the fruit; None where one of them is not known."""

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Each once, in the order of their bits."""
        found = {finding.reason for finding in self.findings}
        return tuple(reason for reason in Reason if reason in found)


_INTERRUPTED = {
    Reason.REFERENCE_BAD: messages.REFERENCE_BAD,
    Reason.IMAGE_STALE: messages.IMAGE_STALE,
    Reason.LATE: messages.LATE,
    Reason.CALLED_OFF: messages.CALLED_OFF,
    Reason.ARM_FAULT: messages.ARM_FAULT,
    Reason.GRIPPER_FAULT: messages.GRIPPER_FAULT,
    Reason.CAMERA_FAULT: messages.CAMERA_FAULT,
    Reason.RECORDS_FAULT: messages.RECORDS_FAULT,
    Reason.STATION_LOST: messages.STATION_LOST,
    Reason.INTERNAL_FAULT: messages.INTERNAL_FAULT,
    Reason.NO_CONTACT: messages.NOTHING_TOUCHED,
}
_DOUBTS = {
    Flag.NO_CONTACT: (Reason.CONTACT_LOST, messages.CONTACT_LOST),
    Flag.UNDECIDED: (Reason.LOW_CONFIDENCE, messages.NO_EDGE),
    Flag.CUT_BY_BORDER: (Reason.CUT_BY_BORDER, messages.CUT_BY_BORDER),
    Flag.LOWER_BOUND: (Reason.LOW_CONFIDENCE, messages.EDGE_LOST),
    Flag.SATURATED: (Reason.SATURATED, messages.SATURATED),
    Flag.REFERENCE_MISMATCH: (Reason.REFERENCE_BAD, messages.REFERENCE_MISMATCH),
}
"""By a flag of a needed step. A confidence that is too small has a message of its own, with its value."""
_LARGER = {Reason.CUT_BY_BORDER, Reason.LOW_CONFIDENCE}
"""Reasons of steps whose contact may reach further than was seen."""
_LATE_START = 0.25
"""Share of the first damage threshold's closing by which the curve may seem to begin after the onset."""


def judge(press: Press, recipe: Recipe) -> Judgement:
    """Judge a press. The same for any order of the points, and for areas and limits in any one unit."""
    case = _case(press, recipe)
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
    # The deciding case may have one limit only; the results are given beside all of them.
    every_limit, evidence = sized_limits(press, recipe).recipe, case.evidence
    areas = tuple(_result(evidence, every_limit, closing_mm) for closing_mm in recipe.steps.result_closings_mm)
    recipe = case.limits.recipe
    last_mm = recipe.damage.area[-1].closing_mm
    if recipe.steps.stop_when_decided:
        partial = evidence.area_at(last_mm) is None
    else:
        partial = areas[-1].area_mm2 is None and not _almost(evidence, recipe)
    order = list(Reason)
    return Judgement(
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
    """Return the reason to make no further step: to spare fruit and gel, or since nothing could change any more.

    Args:
        press: what was measured so far; also what is not trusted counts.
        recipe: its early stop's limits, its closing limit, and whether it stops when decided.

    Returns:
        None where the next step may be made.
    """
    return _case(press, recipe).stopped


def _case(press: Press, recipe: Recipe) -> "_Case":
    """The press beside the limits that decide on it: all of them, or by itself the one that does."""
    if recipe.damage.decided_by == "every_limit":
        return _Case(press, recipe)
    cases = [_Case(press, _with_limit(recipe, limit)) for limit in recipe.damage.area]
    decided, last = [case for case in cases if case.decides], cases[-1]
    if not decided:
        return last
    if recipe.damage.decided_by == "first_trusted":
        return decided[0]
    # Every trusted one: the first that is not kept, of them one that proves damage before one that may be near. Once
    # the last is reached, one that a cut or lost edge reaches is not kept either; where the last's area may be larger
    # than was seen, and nothing else, those before it decide.
    proven = (case for case in decided if case.proves)
    not_kept = next(proven, next((case for case in decided if case.findings), None))
    if not_kept is None and last.reached:
        not_kept = next((case for case in cases if case.may_be_over), None)
    return not_kept or (decided[-1] if last.reached and last.may_be_larger else last)


def _with_limit(recipe: Recipe, limit: AreaThreshold) -> Recipe:
    return recipe.model_copy(update={"damage": recipe.damage.model_copy(update={"area": (limit,)})})


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
        """Limits that are or may be exceeded, and the reasons why the measurement is not trusted."""
        if self.nothing:
            return []
        damage = [] if self.limits.problem is not None else _damage(self.evidence, self.limits)
        return [*damage, *_distrust(self.evidence, self.limits.recipe)]

    @property
    def proves(self) -> bool:
        """True if damage is proven; never where the press is void."""
        return not self.void and any(finding.proves for finding in self.findings)

    @property
    def reached(self) -> bool:
        """True if the last limit's closing was reached."""
        return self.evidence.area_at(self.limits.recipe.damage.area[-1].closing_mm) is not None

    @property
    def may_be_over(self) -> bool:
        """True if an area that is a lower bound may exceed its limit already; what was not seen only adds to it."""
        return {Reason.NEAR_LIMIT} < self._reasons <= {Reason.NEAR_LIMIT, *_LARGER} and self._doubts <= LOWER_BOUNDS

    @property
    def may_be_larger(self) -> bool:
        """True if the limits are met and the only doubt is that the contact may reach further than was seen.

        An area too small for any fruit, a wrong reference or a saturated image speak against the whole press, and so
        do areas that do not rise.
        """
        threshold = self.limits.recipe.damage.area[-1]
        area = self.evidence.area_at(threshold.closing_mm)
        is_fruits = area is not None and area[0] - area[1] >= threshold.least_area_mm2
        return is_fruits and self._reasons <= _LARGER and self._doubts <= LOWER_BOUNDS | {Flag.LOW_CONFIDENCE}

    @property
    def decides(self) -> bool:
        """True if the press is void, damage is proven, or the last limit is reached with no doubt but `NEAR_LIMIT`."""
        if self.void or self.proves:
            return True
        return self.reached and self._reasons <= {Reason.NEAR_LIMIT}

    @property
    def _reasons(self) -> set[Reason]:
        return {finding.reason for finding in self.findings}

    @property
    def _doubts(self) -> set[Flag]:
        """Flags for which needed steps are not trusted, those of excused steps left out."""
        needed = [point for point in self.evidence.needed if point not in self.evidence.excused]
        return {flag for point in needed for flag in self.evidence.doubts(point)}

    @cached_property
    def stopped(self) -> Stop | None:
        """Reason to make no further step; None if one is made."""
        if not self.evidence.points:
            return None
        if self.limits.recipe.steps.stop_when_decided and (why := self._decided()):
            return Stop(why(closing_mm=self.evidence.points[-1].closing_mm))
        finding = _over_early_stop(self.evidence, self.limits.recipe)
        return None if finding is None else Stop(finding.message, finding)

    def _decided(self) -> Definition | None:
        """Return the reason why no further step can change the outcome; None where one can."""
        if self.void:
            return messages.STOPPED_VOID
        if self.proves:
            return messages.STOPPED_DAMAGED
        if self.evidence.points[-1].closing_mm < self.limits.recipe.damage.area[-1].closing_mm:
            return None
        if not self.findings:
            return messages.STOPPED_KEPT
        # Only an onset that excused steps hide may show itself, and with one step more.
        lasting = any(finding.reason is not Reason.AREA_NOT_RISING for finding in self.findings)
        beyond = len(self.evidence.judged) - len(self.evidence.needed)
        return None if self.evidence.excused and not lasting and not beyond else messages.STOPPED_CANNOT_PASS


def _over_early_stop(evidence: Evidence, recipe: Recipe) -> Finding | None:
    """The recipe's limit that ends the steps, passed also by what is not trusted."""
    points, limits = evidence.points, recipe.early_stop
    last, growth = points[-1], evidence.latest_growth
    at_mm = last.closing_mm
    # The largest so far, since a step measured too small afterwards does not spare the fruit.
    over = max(points, key=lambda point: point.area_mm2)
    if over.area_mm2 > limits.area_mm2:
        why = messages.STOPPED_AREA(closing_mm=at_mm, area_mm2=over.area_mm2, limit_mm2=limits.area_mm2)
        return Finding(Reason.EARLY_STOP, why, over.area_mm2, limits.area_mm2, over.closing_mm)
    if growth is not None and growth.mm2_per_mm > limits.growth_mm2_per_mm:
        why = messages.STOPPED_GROWTH(closing_mm=at_mm, growth=growth.mm2_per_mm, limit=limits.growth_mm2_per_mm)
        return Finding(Reason.EARLY_STOP, why, growth.mm2_per_mm, limits.growth_mm2_per_mm, growth.to_closing_mm)
    limit_mm = recipe.steps.closing_limit_mm
    if at_mm >= limit_mm:
        why = messages.STOPPED_CLOSING(closing_mm=at_mm, limit_mm=limit_mm)
        return Finding(Reason.EARLY_STOP, why, at_mm, limit_mm, at_mm)
    return _hopeless(evidence, recipe)


def _hopeless(evidence: Evidence, recipe: Recipe) -> Finding | None:
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
    why = messages.STOPPED_UNTRUSTED(closing_mm=last.closing_mm)
    return Finding(Reason.EARLY_STOP, why, area[0], threshold.least_area_mm2, threshold.closing_mm)


def _void(press: Press, limits: SizedLimits) -> Iterator[Finding]:
    """Yield the findings that make the whole press invalid: nothing in it proves damage."""
    recipe = limits.recipe
    for reason in dict.fromkeys(press.interruptions):
        known = _INTERRUPTED.get(reason)
        yield Finding(reason, known() if known else messages.INTERRUPTED(why=reason_message(reason)))
    if press.onset_mm is None:
        if Reason.NO_CONTACT not in press.interruptions:
            yield Finding(Reason.NO_CONTACT, messages.NOTHING_TOUCHED())
        return
    if press.onset_uncertainty_mm is None:
        # The fruit is wider than this width by an unknown amount: neither its width nor its size can be checked.
        why = messages.TOUCHED_AT_FIRST(width_mm=press.onset_mm)
        yield Finding(Reason.OUT_OF_RANGE, why, press.onset_mm, None, 0.0)
        return
    expected = recipe.expected_width
    if not expected.smallest_mm <= press.onset_mm <= expected.largest_mm:
        beyond = expected.smallest_mm if press.onset_mm < expected.smallest_mm else expected.largest_mm
        why = messages.WRONG_WIDTH(
            width_mm=press.onset_mm,
            recipe=recipe.title,
            smallest_mm=expected.smallest_mm,
            largest_mm=expected.largest_mm,
        )
        yield Finding(Reason.OUT_OF_RANGE, why, press.onset_mm, beyond, 0.0)
    if limits.problem is not None:
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
    reason, said = (
        (Reason.GROWTH_OVER_LIMIT, messages.GROWTH_OVER) if proofs else (Reason.NEAR_LIMIT, messages.GROWTH_NEAR)
    )
    why = said(
        from_mm=worst.from_closing_mm,
        to_mm=worst.to_closing_mm,
        growth=worst.mm2_per_mm,
        uncertainty=worst.uncertainty_mm2_per_mm,
        limit=limit,
    )
    yield Finding(reason, why, worst.mm2_per_mm, limit, worst.to_closing_mm, proves=bool(proofs))


def _area(evidence: Evidence, threshold: AreaThreshold, limits: SizedLimits) -> Iterator[Finding]:
    """One area threshold."""
    closing_mm, limit = threshold.closing_mm, threshold.area_mm2
    least, area = evidence.least_area_mm2(closing_mm), evidence.area_at(closing_mm)
    if least is not None and least > limit:
        why = messages.AREA_OVER(closing_mm=closing_mm, area_mm2=least, limit=limit_message(limit, limits))
        yield Finding(Reason.AREA_OVER_LIMIT, why, least, limit, closing_mm, proves=True)
    elif area is not None and sum(area) > limit:
        why = messages.AREA_NEAR(
            closing_mm=closing_mm, area_mm2=area[0], uncertainty_mm2=area[1], limit=limit_message(limit, limits)
        )
        yield Finding(Reason.NEAR_LIMIT, why, area[0], limit, closing_mm)
    elif area is not None and area[0] - area[1] < threshold.least_area_mm2:
        why = messages.AREA_SMALL(
            closing_mm=closing_mm, area_mm2=area[0], uncertainty_mm2=area[1], least_mm2=threshold.least_area_mm2
        )
        yield Finding(Reason.LOW_CONFIDENCE, why, area[0], threshold.least_area_mm2, closing_mm)


def limit_message(limit_mm2: float, limits: SizedLimits) -> Message:
    """An area limit with the fruit that it is for, as part of a sentence."""
    if limits.without_size:
        return messages.LIMIT_WITHOUT_SIZE(limit_mm2=limit_mm2)
    if limits.length_mm is None:
        return messages.LIMIT(limit_mm2=limit_mm2)
    return messages.LIMIT_OF_LENGTH(fruit=limits.recipe.title, length_mm=limits.length_mm, limit_mm2=limit_mm2)


def _distrust(evidence: Evidence, recipe: Recipe) -> Iterator[Finding]:
    """Yield the reasons why the measurement is not trusted."""
    needed = [point for point in evidence.needed if point not in evidence.excused]
    for flag, (reason, said) in _DOUBTS.items():
        if doubtful := [point for point in needed if flag in evidence.doubts(point)]:
            yield Finding(reason, said(closings=_closings(doubtful)), closing_mm=_least_sure(doubtful).closing_mm)
    if doubtful := [point for point in needed if Flag.LOW_CONFIDENCE in evidence.doubts(point)]:
        worst, least = _least_sure(doubtful), recipe.segmentation.robust.least_confidence
        if worst.confidence is None:
            why = messages.NO_CONFIDENCE(closings=_closings(doubtful), least=least)
        else:
            why = messages.LOW_CONFIDENCE(closings=_closings(doubtful), confidence=worst.confidence, least=least)
        yield Finding(Reason.LOW_CONFIDENCE, why, worst.confidence, least, worst.closing_mm)
    if falling := [point for point in evidence.falling if point in evidence.needed]:
        points = [messages.POINT(closing_mm=point.closing_mm, area_mm2=point.area_mm2) for point in falling]
        why = messages.NOT_RISING(points=points, number=len(points))
        yield Finding(Reason.AREA_NOT_RISING, why, falling[0].area_mm2, None, falling[0].closing_mm)
    yield from _onset(evidence, recipe)


def _closings(points: Sequence[Measured]) -> list[Message]:
    return [messages.CLOSING(closing_mm=point.closing_mm) for point in points]


def _least_sure(points: Sequence[Measured]) -> Measured:
    return min(points, key=lambda point: point.confidence or 0.0)


def _onset(evidence: Evidence, recipe: Recipe) -> Iterator[Finding]:
    """Yield a finding if the curve does not begin at the onset: one seen too soon makes every area seem too small."""
    begins_mm = evidence.begins_at_mm
    allowed_mm = _LATE_START * recipe.damage.area[0].closing_mm
    if evidence.needed and (begins_mm is None or begins_mm > allowed_mm):
        if begins_mm is None:
            why = messages.NO_ONSET()
        else:
            why = messages.LATE_ONSET(begins_mm=begins_mm, allowed_mm=allowed_mm)
        yield Finding(Reason.AREA_NOT_RISING, why, begins_mm, allowed_mm, 0.0)


def _reach(case: _Case, stopped: Stop | None) -> Iterator[Finding]:
    """Yield a finding if a damage threshold was not reached, or if the steps did not end as they should."""
    evidence, recipe = case.evidence, case.limits.recipe
    missing = [limit for limit in recipe.damage.area if evidence.area_at(limit.closing_mm) is None]
    reached_mm = evidence.reached_mm
    if stopped is None and (missing or not _almost(evidence, recipe)):
        if case.press.interruptions:  # which say why
            return
        wanted_mm = missing[0].closing_mm if missing else recipe.steps.result_closings_mm[-1]
        why = messages.STEPS_ENDED(reached_mm=reached_mm, wanted_mm=wanted_mm)
        yield Finding(Reason.INTERNAL_FAULT, why, reached_mm, wanted_mm, reached_mm)
    elif missing and stopped is not None and stopped.finding is not None:
        unknown = messages.AREA_UNKNOWN(closing_mm=missing[0].closing_mm)
        yield replace(stopped.finding, message=joined([stopped.message, unknown]))


def _almost(evidence: Evidence, recipe: Recipe) -> bool:
    """Return whether the last result's closing was reached, or missed by less than a step: a gripper has counts."""
    return evidence.reached_mm > recipe.steps.result_closings_mm[-1] - recipe.steps.step_mm


def _result(evidence: Evidence, recipe: Recipe, closing_mm: float) -> AreaAt:
    area, uncertainty = evidence.area_at(closing_mm) or (None, None)
    limits = [threshold.area_mm2 for threshold in recipe.damage.area if threshold.closing_mm == closing_mm]
    return AreaAt(closing_mm, area, uncertainty, limits[0] if limits else None)


def _summary(case: _Case) -> Message | None:
    threshold, limits = case.limits.recipe.damage.area[-1], case.limits
    area = case.evidence.area_at(threshold.closing_mm)
    if area is None or limits.problem is not None:
        return None
    return messages.AREA_AND_LIMIT(
        closing_mm=threshold.closing_mm,
        area_mm2=area[0],
        uncertainty_mm2=area[1],
        limit=limit_message(threshold.area_mm2, limits),
    )


def _deciding(evidence: Evidence, recipe: Recipe, proofs: list[Finding]) -> Measured | None:
    """The trusted point nearest to the first proof, or to the last damage threshold."""
    trusted = [point for point in evidence.judged if evidence.bounds(point)]
    place_mm = proofs[0].closing_mm if proofs else recipe.damage.area[-1].closing_mm
    return min(trusted, key=lambda point: abs(point.closing_mm - (place_mm or 0.0)), default=None)
