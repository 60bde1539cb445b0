"""Replay of a stored inspection by a draft; a result that cannot be known is reported as unknown.

A stored curve ends where the inspection's own recipe ended it. A draft that would have continued has only the verdicts
that are certain at that point: proven damage, and a fruit that no further step could let pass.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pydantic import ValidationError

from station.inspection.judge import Judgement, early_stop, judge
from station.inspection.press import Press
from station.inspection.second_press import needs_second_press, together
from station.messages import whatif as messages
from station.messages.message import Message, joined
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import upgrade
from station.vocabulary import OutcomeName
from station.whatif.remeasure import CannotRemeasureError, remeasured
from station.whatif.stored import StoredPress

After = Literal["PASS", "FAIL", "NO_RESULT", "UNDECIDABLE"]


@dataclass(frozen=True, slots=True)
class Replayed:
    """Result of the draft on one inspection."""

    sequence: int
    lot: str
    before: OutcomeName
    after: After
    why: Message | None
    """The draft's reasons, or why the result is unknown; None for PASS."""
    faithful: bool
    """Judged again by its own recipe, the inspection has the stored outcome."""
    areas_mm2: tuple[float, ...] = ()
    """Of the steps, as the draft measures the stored images; empty if it measures as the inspection's own recipe."""

    @property
    def changes_side(self) -> Literal["", "passes", "rejected"]:
        """Side that the fruit changes to; empty if it stays on its side or the draft's outcome is unknown."""
        if self.after == "UNDECIDABLE" or (self.before == "PASS") == (self.after == "PASS"):
            return ""
        return "passes" if self.after == "PASS" else "rejected"


def recipe_of_snapshot(text: str) -> Recipe | None:
    """Parse a recipe as stored, of any released schema; None if this program does not accept it any more."""
    values = json.loads(text)
    try:
        upgrade(values)
        return Recipe.model_validate_json(json.dumps(values))
    except (ValidationError, KeyError, TypeError, AttributeError):
        return None


def replay(stored: StoredPress, own: Recipe | None, draft: Recipe) -> Replayed:
    """Judge one stored inspection by a draft.

    Args:
        stored: with images if the draft finds contacts differently from `own`.
        own: the recipe of the inspection; None if it is not known any more.
    """
    if own is None:
        return _undecidable(stored, messages.OLD_RECIPE(), faithful=False)
    faithful = judge(stored.judged, own).outcome == stored.before
    if why := pressed_otherwise(own, draft):
        return _undecidable(stored, why, faithful=faithful)
    press = stored.press
    if press.onset_mm is None or not measured_otherwise(own, draft):
        presses = [press] if stored.first is None else [stored.first, press]
        return _judged(stored, [(each, each) for each in presses], own, draft, faithful=faithful)
    if stored.first is not None:
        return _undecidable(stored, messages.FIRST_IMAGES_NOT_KEPT(), faithful=faithful)
    try:
        again = remeasured(stored, own.segmentation, draft.segmentation)
    except CannotRemeasureError as error:
        return _undecidable(stored, error.message, faithful=faithful)
    replayed = _judged(stored, [(press, again)], own, draft, faithful=faithful)
    return replace(replayed, areas_mm2=tuple(point.area_mm2 for point in again.points))


def pressed_otherwise(own: Recipe, draft: Recipe) -> Message | None:
    """Return why a curve pressed by one recipe is no evidence for the other; None if it is."""
    pairs = {
        "gripper": (own.gripper, draft.gripper),
        "imaging": (own.imaging, draft.imaging),
        "steps.start": (own.steps.start, draft.steps.start),
        "steps.start_width_mm": (own.steps.start_width_mm, draft.steps.start_width_mm),
        "steps.step_mm": (own.steps.step_mm, draft.steps.step_mm),
        "steps.measured": (own.steps.measured, draft.steps.measured),
        "press.centre_from_mm": (own.press.centre_from_mm, draft.press.centre_from_mm),
    }
    other = [name for name, (before, after) in pairs.items() if before != after]
    return messages.PRESSES_OTHERWISE(fields=", ".join(other)) if other else None


def measured_otherwise(own: Recipe, draft: Recipe) -> bool:
    """Check whether the areas have to be measured again: the method, or one of its parameters, differs."""
    before, after = own.segmentation, draft.segmentation
    if before.method != after.method:
        return True
    if before.method == "paper":
        return before.paper != after.paper
    # The least confidence too: it is no matter of the judge's alone, but decides what an image's contact is drawn from.
    return before.robust != after.robust


def _judged(
    stored: StoredPress, presses: Sequence[tuple[Press, Press]], own: Recipe, draft: Recipe, *, faithful: bool
) -> Replayed:
    """Judge press after press, each as measured and as the draft measures it, as often as the draft would press."""
    for pressed in range(1, len(presses) + 1):
        then, now = (together(each) for each in zip(*presses[:pressed], strict=True))
        verdict = _judgement(then, now, own, draft)
        if isinstance(verdict, Message):
            return _undecidable(stored, verdict, faithful=faithful)
        if pressed >= draft.press.attempts or not needs_second_press(verdict):
            return _decided(stored, verdict, faithful=faithful)
    return _undecidable(stored, messages.ANOTHER_PRESS(), faithful=faithful)


def _judgement(then: Press, whole: Press, own: Recipe, draft: Recipe) -> Judgement | Message:
    """Return the draft's verdict on presses together, or why it is not known."""
    if whole.onset_mm is None:
        # The draft searches no deeper, so it touches nothing either.
        sooner = draft.expected_width.smallest_mm >= own.expected_width.smallest_mm
        if sooner or whole.interruptions:
            return judge(whole, draft)
        return messages.CLOSES_FURTHER()
    stopped = judge(then, own).stopped is not None
    press = _until_stop(whole, draft)
    verdict = judge(press, draft)
    proven = verdict.outcome == "FAIL"
    void = bool(press.interruptions) or not _fits(press.onset_mm, draft)
    # Steps that no rule stopped ended by the gripper, held or closed, or by their number; the draft's end there too.
    ended = _at_its_last_step(press, draft) or (
        not stopped and draft.steps.number == own.steps.number and len(press.points) == len(whole.points)
    )
    if proven or void or ended or verdict.stopped is not None:
        return verdict
    if (hopeless := judge(press, _stopping(draft))).stopped is not None and hopeless.outcome != "PASS":
        return hopeless
    reached_mm = press.points[-1].closing_mm if press.points else 0.0
    return (messages.CURVE_STOPPED if stopped else messages.CURVE_ENDS)(reached_mm=reached_mm)


def _until_stop(press: Press, draft: Recipe) -> Press:
    """Return the existing points that the draft would have taken."""
    last_mm = draft.steps.travel_mm + draft.steps.step_mm / 2
    points = tuple(point for point in press.points if point.closing_mm < last_mm)
    for number in range(1, len(points)):
        if early_stop(replace(press, points=points[:number]), draft) is not None:
            return replace(press, points=points[:number])
    return replace(press, points=points)


def _at_its_last_step(press: Press, draft: Recipe) -> bool:
    """Check whether the closing of the last step was reached, to half a step: a gripper has counts."""
    half_mm = draft.steps.step_mm / 2
    return bool(press.points) and press.points[-1].closing_mm > draft.steps.travel_mm - half_mm


def _stopping(draft: Recipe) -> Recipe:
    """Return the draft with the early stop: no step that cannot change the outcome."""
    return draft.model_copy(update={"steps": draft.steps.model_copy(update={"stop_when_decided": True})})


def _fits(onset_mm: float | None, draft: Recipe) -> bool:
    expected = draft.expected_width
    return onset_mm is not None and expected.smallest_mm <= onset_mm <= expected.largest_mm


def _decided(stored: StoredPress, verdict: Judgement, *, faithful: bool) -> Replayed:
    found = [finding.message for finding in verdict.findings]
    why = joined(found) if found else None
    return Replayed(stored.sequence, stored.lot, stored.before, verdict.outcome, why, faithful)


def _undecidable(stored: StoredPress, why: Message, *, faithful: bool) -> Replayed:
    return Replayed(stored.sequence, stored.lot, stored.before, "UNDECIDABLE", why, faithful)
