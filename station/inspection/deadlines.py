"""Deadlines of each phase and of a whole inspection, from the recipe; late is a comparison of values."""

from math import ceil
from typing import NamedTuple

from station.errors import BadInputError
from station.inspection.cycle import Event
from station.inspection.press import FINEST_STEP_MM
from station.inspection.second_press import FREED_BY_MM
from station.inspection.states import State
from station.messages.operation import INSPECTION_TOO_LONG as TOO_LONG
from station.settings.recipe_model import Recipe

PHASE_MARGIN, INSPECTION_MARGIN = 3.0, 1.5
"""Factors on the time that is expected. A phase alone may be far off before it is a fault; of many phases the
deviations cancel, so the whole is known better than its parts."""
GRACE_S = 1.0
"""Added to each: a busy machine's scheduler, and a gripper's or an arm's answer."""
LONGEST_S = 600.0
"""Longest deadline that the PLC interface accepts (`BeginReply.deadline_s`), s, without the time to record it."""
OVERSHOOT_MM = 1.2
"""Largest travel from the first frame with a contact to the stop, mm; measured on the twin (docs/cycle-time.md)."""

_RAMP_S = 0.2
"""Acceleration, braking and arrival of one motion of the gripper; 9 ms on the twin (docs/gripper.md), with room for
fingers that have mass and for a slow line. Unverified on hardware."""
_SLOWEST_OPENING_MM_S = 20.0
"""The 2F-85's slowest speed, mm/s."""
_CENTRING_S = 0.5
"""A few millimetres of the tool; 0.2 s on the twin. Unverified on hardware."""
_RECOVERY_S = 20.0
"""Power, brakes and program of an arm."""


class Pace(NamedTuple):
    """Speeds and durations of one cell."""

    frames_per_s: float
    arm_move_s: float
    """The longest motion of the arm between two of its places; 0 on a bench without an arm."""
    arm_way_s: float
    """Its way from home over the place above the nest to the nest; 0 without an arm."""
    opening_mm_s: float
    """Speed of the jaws without a fruit."""
    stroke_mm: float
    """Width of the open jaws."""
    record_s: float
    """A durable write, on a slow disk."""
    measure_s: float
    """The measurement of one image."""


class Deadlines(NamedTuple):
    """Seconds from a phase's begin, or from the accepted trigger."""

    phases_s: dict[State, float]
    """For every state in which something is waited for."""
    inspection_s: float
    """From the accepted trigger to the durable outcome; past it the outcome is NO_RESULT."""
    longest_path_s: float
    """What the recipe needs where every device does as it should: no deadline of an inspection may be shorter."""


class Late(NamedTuple):
    """A deadline that has passed, as the event that the cycle takes."""

    event: Event
    """`LATE` for the whole inspection, else the fault of what was waited for."""
    state: State
    took_s: float
    allowed_s: float


_OPENING = (
    State.OPENING_AGAIN,
    State.RELEASING,
    State.RESETTING,
    State.OPENING_HELD,
    State.OPENING_UNRECORDED,
)
_WAITS_FOR = {
    Event.ARM_FAULT: (
        State.APPROACHING,
        State.CENTRING,
        State.RETREATING,
        State.RETREATING_READY,
        State.RETREATING_ACCEPTED,
        State.HOMING,
        State.HOMING_UNRECORDED,
        State.RECOVERING,
    ),
    Event.GRIPPER_FAULT: (
        State.CLOSING_TO_ONSET,
        State.MOVING,
        State.MOVING_MEASURING,
        *_OPENING,
        State.PLACING_ACCEPT,
        State.PLACING_REJECT,
    ),
    Event.CAMERA_FAULT: (State.REFERENCE, State.CAPTURING, State.CAPTURING_MEASURING),
    Event.RECORDS_FAULT: (
        State.ACCEPTING,
        State.RETREATING_ACCEPTING,
        State.CLEARING,
        State.RECORDING_ACCEPT,
        State.RECORDING_REJECT,
        State.RECORDING_RELEASE,
        State.RECORDING_HELD,
        State.RECORDING_LATCHED,
    ),
    Event.INTERNAL_FAULT: (
        State.SETTLING,
        State.SETTLING_MEASURING,
        State.AWAITING_MEASURE,
        State.AWAITING_MEASURE_LAST,
        State.MEASURING_LAST,
        State.JUDGING,
        State.CHECKING,
    ),
}
FAULT_OF: dict[State, Event] = {state: event for event, states in _WAITS_FOR.items() for state in states}
"""Whose fault it is when a state lasts too long."""


def deadlines(recipe: Recipe, pace: Pace) -> Deadlines:
    """The deadlines of a recipe's inspection on a cell.

    Raises:
        BadInputError: the inspection would take longer than the longest deadline that the PLC interface accepts.
    """
    expected_s = _expected(recipe, pace)
    longest_path_s = _longest_path_s(recipe, pace)
    inspection_s = GRACE_S + INSPECTION_MARGIN * longest_path_s
    if inspection_s > LONGEST_S:
        raise BadInputError(TOO_LONG(recipe=recipe.name, needed_s=inspection_s, limit_s=LONGEST_S))
    phases_s = {state: GRACE_S + PHASE_MARGIN * expected_s.get(state, 0.0) for state in FAULT_OF}
    return Deadlines(phases_s, inspection_s, longest_path_s)


def _longest_path_s(recipe: Recipe, pace: Pace) -> float:
    """The time of a fruit that is centred and pressed as often as the recipe may, each time to its last limit."""
    speed_mm_s, step_mm = recipe.gripper.speed_mm_s, recipe.steps.step_mm
    capturing_s = recipe.imaging.frames_per_step / pace.frames_per_s
    # The arm and the jaws move at the same time.
    approach_s = max(pace.arm_way_s, pace.stroke_mm / pace.opening_mm_s) + _RAMP_S
    expected = recipe.expected_width
    # From around the largest fruit down to a step below the smallest one, where the approach ends (`stop.lowest_mm`).
    sweep_s = (min(expected.largest_mm, pace.stroke_mm) - expected.smallest_mm + step_mm) / speed_mm_s + _RAMP_S
    # Back to where nothing touches, then count by count with one frame each, and once more with all.
    glances = ceil(OVERSHOOT_MM / FINEST_STEP_MM) + 1
    onset_s = _RAMP_S + glances * (_RAMP_S + pace.measure_s) + (glances - 1) / pace.frames_per_s + capturing_s
    steps = recipe.steps.number
    if recipe.steps.stop_when_decided:
        steps = min(steps, ceil(recipe.damage.area[-1].closing_mm / step_mm))
    # A step is measured while the next one is made: the slower of both counts. Two may be left after the last image.
    step_s = max(step_mm / speed_mm_s + _RAMP_S + recipe.imaging.settle_s + capturing_s, pace.measure_s)
    press_s = steps * step_s + 2 * pace.measure_s
    # The jaws open beside the fruit, the sensor moves, and the jaws close again to where it was met.
    again_s = 2 * (FREED_BY_MM / speed_mm_s + _RAMP_S) + (_CENTRING_S if pace.arm_way_s else 0.0) + onset_s
    centrings = 0 if recipe.press.centre_from_mm is None or not pace.arm_way_s else 1
    return (
        approach_s
        + recipe.imaging.reference_frames / pace.frames_per_s
        + sweep_s
        + onset_s
        + press_s
        + centrings * again_s
        + (recipe.press.attempts - 1) * (again_s + press_s)
    )


def late(limits: Deadlines, state: State, in_state_s: float, since_trigger_s: float | None) -> Late | None:
    """Return the deadline that has passed, if any; the inspection's is checked before the phase's.

    Args:
        limits: from `deadlines`.
        in_state_s: time since it was entered.
        since_trigger_s: time since the trigger was accepted; None once its outcome is durable, and outside an
            inspection.
    """
    if since_trigger_s is not None and since_trigger_s > limits.inspection_s:
        return Late(Event.LATE, state, since_trigger_s, limits.inspection_s)
    allowed_s = limits.phases_s.get(state)
    if allowed_s is not None and in_state_s > allowed_s:
        return Late(FAULT_OF[state], state, in_state_s, allowed_s)
    return None


def _expected(recipe: Recipe, pace: Pace) -> dict[State, float]:
    """Return each state's expected duration, s; a state that is not listed takes no time."""
    steps, imaging = recipe.steps, recipe.imaging
    without_stop_mm = recipe.damage.passing_closing_mm if steps.measured == "while_closing" else 0.0
    # Closing without a stop is one motion, to the last limit that has to be met.
    moving_s = max(steps.step_mm, without_stop_mm) / recipe.gripper.speed_mm_s + _RAMP_S
    capturing_s = imaging.frames_per_step / pace.frames_per_s
    opening_s = pace.stroke_mm / _SLOWEST_OPENING_MM_S + _RAMP_S
    searched = max(0.0, pace.stroke_mm - recipe.expected_width.smallest_mm) / steps.step_mm + 1
    placing_s = 3 * pace.arm_move_s + opening_s
    expected_s = {
        State.REFERENCE: imaging.reference_frames / pace.frames_per_s,
        State.APPROACHING: max(2 * pace.arm_move_s, opening_s),  # the jaws close meanwhile to the fruit's width
        State.CENTRING: min(pace.arm_move_s, _CENTRING_S),
        State.CLOSING_TO_ONSET: searched * (moving_s + imaging.settle_s + capturing_s + pace.measure_s),
        State.MOVING: moving_s,
        State.MOVING_MEASURING: moving_s + pace.measure_s,  # a step that may decide is measured before the next
        State.SETTLING: imaging.settle_s,
        State.SETTLING_MEASURING: imaging.settle_s,
        State.CAPTURING: capturing_s,
        State.CAPTURING_MEASURING: capturing_s,
        State.AWAITING_MEASURE: pace.measure_s,
        State.AWAITING_MEASURE_LAST: pace.measure_s,
        State.MEASURING_LAST: pace.measure_s,
        State.PLACING_ACCEPT: placing_s,
        State.PLACING_REJECT: placing_s,
        State.RECOVERING: _RECOVERY_S,
    }
    expected_s |= dict.fromkeys(_OPENING, opening_s)
    leaving = (State.RETREATING, State.RETREATING_READY, State.RETREATING_ACCEPTED)
    # The jaws open meanwhile.
    expected_s |= dict.fromkeys((*leaving, State.HOMING, State.HOMING_UNRECORDED), max(2 * pace.arm_move_s, opening_s))
    return expected_s | dict.fromkeys(_WAITS_FOR[Event.RECORDS_FAULT], pace.record_s)
