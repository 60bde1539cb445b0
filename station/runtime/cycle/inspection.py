"""Inspection: data of one inspection from its trigger to its record."""

import time
from dataclasses import dataclass, field

from station.channel.line import Outcome
from station.clock import utc_ms
from station.inspection.centring import NOT_MOVED, Offset
from station.inspection.deadlines import Deadlines
from station.inspection.judge import Judgement
from station.inspection.press import Measured, Press
from station.inspection.second_press import together
from station.messages.message import Message
from station.press.measurement import measured_point
from station.press.rig import MeasuredStep, Step
from station.press.stop import steps_to_decide
from station.records.first_press import first_press_findings, first_press_measures
from station.records.judgement import judgement_measures
from station.records.model import CurvePoint, Image, InspectionRecord, Trigger
from station.runtime.recipes.active import ActiveRecipe
from station.vocabulary import OutcomeName, Reason


@dataclass(slots=True)
class Inspection:
    """From the trigger to the record."""

    trigger: Trigger
    active: ActiveRecipe
    limits: Deadlines
    mm_per_px: float
    calibration: str
    """As text, for the record."""
    scale_uncertainty: float
    """Relative standard uncertainty of `mm_per_px`."""
    resolution_mm: float
    """One count of the gripper."""
    began_s: float = field(default_factory=time.monotonic)
    sequence: int | None = None
    """Once it is durable."""
    accepted_s: float | None = None
    reference_s: float | None = None
    """Capture of the reference's last frame; monotonic, as are all times in s."""
    reference_image: Image | None = None
    before_onset_mm: float | None = None
    """The last width at which nothing touched."""
    met_mm: float | None = None
    """The width at which an earlier closing met the fruit; None in the first."""
    clear_mm: float | None = None
    """The width beside it at which nothing touched then; None where there was none."""
    closings: int = 0
    """How often the jaws have closed on the fruit."""
    moved: Offset = NOT_MOVED
    """Where the sensor is, from its place at the taught nest."""
    target: Offset | None = None
    """Where it has to go before the next closing; None where it stays."""
    closed_steps: int = 0
    """Steps of the recipe by which the jaws have closed since the first image."""
    steps: list[Step] = field(default_factory=list)
    """Captured, in order; more than `closed_steps` where they are also taken while the jaws close."""
    seen: list[MeasuredStep] = field(default_factory=list)
    """Measured, in order."""
    earlier: list[Press] = field(default_factory=list)
    """Presses on this fruit that were inconclusive; `steps` and `seen` are those of the present one."""
    first_verdict: Judgement | None = None
    """On the first press, where it was inconclusive."""
    interruptions: list[Reason] = field(default_factory=list)
    explanation: list[Message] = field(default_factory=list)
    verdict: Judgement | None = None
    outcome_name: OutcomeName = "NO_RESULT"
    phases_s: dict[str, float] = field(default_factory=dict)
    measures: dict[str, float | int | str | bool | None] = field(default_factory=dict)
    standing: Outcome | None = None
    """What the records hold."""
    published: Outcome | None = None
    """What the PLC was given, which may be NO_RESULT for a fruit that was judged in time and recorded too late."""

    @property
    def is_accepted(self) -> bool:
        """True if the fruit passes: by the outcome that the PLC was given, or else by the recorded one."""
        final = self.published or self.standing
        return final is not None and final.outcome == "PASS"

    @property
    def next_width_mm(self) -> float:
        """The width of the next step, counted from the measured width of the first."""
        return self._width_after(self.closed_steps + 1)

    @property
    def deciding_width_mm(self) -> float:
        """The width of the first step that reaches the last damage threshold that the fruit has to keep."""
        return self._width_after(self.steps_to_decide)

    @property
    def steps_to_decide(self) -> int:
        """Number of steps from the first image to the last damage threshold that the fruit has to keep."""
        return steps_to_decide(self.active.recipe)

    def whole_steps_to(self, width_mm: float) -> int:
        """Count the whole steps between the first image and a width."""
        return int((self.steps[0].move.width_mm - width_mm) / self.active.recipe.steps.step_mm)

    def _width_after(self, steps: int) -> float:
        return self.steps[0].move.width_mm - steps * self.active.recipe.steps.step_mm

    @property
    def presses_made(self) -> int:
        """Number of presses so far, the present one counted."""
        return 1 + len(self.earlier)

    @property
    def onset_mm(self) -> float | None:
        """The measured width of the first contact; None before it."""
        return next((seen.step.move.width_mm for seen in self.seen if seen.contact.is_firm), None)

    def interrupt(self, reason: Reason, why: Message | None) -> None:
        """Note an interruption: its reason for the PLC, and its message for a person."""
        if reason not in self.interruptions:
            self.interruptions.append(reason)
        if why is not None and why not in self.explanation:
            self.explanation.append(why)

    def press_again(self) -> None:
        """Begin another press on the fruit. Of the one before stays what was measured, not its images."""
        self.first_verdict = self.verdict
        self.earlier.append(self._latest())
        self.verdict = None
        self.let_go(self.onset_mm, self.before_onset_mm)

    def let_go(self, met_mm: float | None, clear_mm: float | None) -> None:
        """Begin another closing: the steps of this one are discarded.

        Args:
            met_mm: the width at which this closing met the fruit.
            clear_mm: the width beside it at which nothing touched; None where there was none.
        """
        self.met_mm, self.clear_mm, self.before_onset_mm, self.closed_steps = met_mm, clear_mm, None, 0
        self.steps.clear()
        self.seen.clear()

    def forget_pictures(self) -> None:
        """Release the frames, which are in the records by now or never will be."""
        self.steps.clear()
        self.seen.clear()
        self.reference_image = None

    def press(self) -> Press:
        """Return all presses so far as one."""
        return together([*self.earlier, self._latest()])

    def _latest(self) -> Press:
        """The present press."""
        onset_mm, points = self.onset_mm, tuple[Measured, ...]()
        sooner_mm: float | None = 0.0
        if onset_mm is not None:
            untouched = [seen.step.move.width_mm for seen in self.seen if seen.step.move.width_mm > onset_mm]
            if self.before_onset_mm is not None:
                untouched.append(self.before_onset_mm)
            sooner_mm = min(untouched) - onset_mm if untouched else None
            points = tuple(
                measured_point(seen.contact, onset_mm - seen.step.move.width_mm, self.mm_per_px) for seen in self.seen
            )
        return Press(
            onset_mm,
            sooner_mm,
            points,
            tuple(self.interruptions),
            self.trigger.size,
            self.resolution_mm,
            self.scale_uncertainty,
        )

    def record(self) -> InspectionRecord:
        """Return the record to store."""
        verdict, onset_mm = self.verdict, self.onset_mm
        deciding = verdict.deciding if verdict is not None else None
        found = [finding.reason for finding in verdict.findings] if verdict is not None else []
        if self.interruptions and not self.seen:
            found = []  # that nothing was touched is no news where nothing was looked at
        reasons = tuple(dict.fromkeys([*self.interruptions, *found]))
        said = [finding.message for finding in verdict.findings if finding.reason in found] if verdict else []
        return InspectionRecord(
            outcome=self.outcome_name,
            reasons=() if self.outcome_name == "PASS" else tuple(map(str, reasons)),
            explanation=tuple(dict.fromkeys([*self.explanation, *said])),
            late=Reason.LATE in self.interruptions,
            partial=verdict.partial if verdict is not None else True,
            area_mm2=None if deciding is None else deciding.area_mm2,
            area_px=None if deciding is None else deciding.area_px,
            closing_mm=None if deciding is None else deciding.closing_mm,
            confidence=None if deciding is None else deciding.confidence,
            ended_utc_ms=utc_ms(),
            duration_ms=round(1000 * (time.monotonic() - self.began_s)),
            curve=tuple(self._point(number, seen, onset_mm) for number, seen in enumerate(self.seen)),
            phases_s=dict(self.phases_s),
            measures={
                **self.measures,
                **first_press_measures(self.earlier),
                "closings": self.closings,
                "onset_mm": onset_mm,
                "onset_uncertainty_mm": self.press().onset_uncertainty_mm,
                "mm_per_px": self.mm_per_px,
                "scale_uncertainty": self.scale_uncertainty,
                "gripper_resolution_mm": self.resolution_mm,
                **({} if verdict is None else judgement_measures(verdict)),
            },
            judgement=verdict.summary if verdict is not None else None,
            first_press_findings=first_press_findings(self.first_verdict),
            images=self._images(),
        )

    def _point(self, number: int, seen: MeasuredStep, onset_mm: float | None) -> CurvePoint:
        width_mm = seen.step.move.width_mm
        return CurvePoint(
            step=number,
            width_mm=width_mm,
            closing_mm=None if onset_mm is None else onset_mm - width_mm,
            area_mm2=seen.contact.area_px * self.mm_per_px**2,
            area_px=seen.contact.area_px,
            confidence=seen.contact.confidence,
            flags=tuple(sorted(flag.value for flag in seen.contact.flags)),
            captured_s=seen.step.last_frame.captured_s - self.began_s,
            changed_area_mm2=self._mm2(seen.contact.changed_area_px),
            changed_area_px=seen.contact.changed_area_px,
        )

    def _mm2(self, area_px: int | None) -> float | None:
        return None if area_px is None else area_px * self.mm_per_px**2

    def _images(self) -> tuple[Image, ...]:
        steps = [
            image
            for number, seen in enumerate(self.seen)
            for image in (Image("step", number, seen.image), Image("mask", number, seen.contact.mask))
        ]
        return (*([] if self.reference_image is None else [self.reference_image]), *steps)
