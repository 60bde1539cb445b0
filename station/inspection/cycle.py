"""The cycle of the station as one table: (state, event) → (state, actions).

The service carries the actions out in their order and reports what came of them as events; it owns clocks, deadlines
and devices. Nothing is done twice for one event, and a pair that the table does not list changes nothing.
"""

from collections import Counter
from collections.abc import Iterable
from enum import StrEnum
from typing import NamedTuple

from station.inspection.alarm_table import AlarmId
from station.inspection.states import STATES, State, StateFacts
from station.vocabulary import Reason


class Event(StrEnum):
    """Event of the cycle: a finished action, a fault, or a request."""

    READY = "ready"
    """Every device that an inspection needs answers, is able and was read just now; the records can be written."""
    TRIGGER = "trigger"
    TRIGGER_RECORDED = "trigger_recorded"
    REFERENCE_BAD = "reference_bad"
    ARRIVED = "arrived"
    ONSET_FOUND = "onset_found"
    """The gel is touched, or the recipe's start width is reached; its image is the curve's first point."""
    OFF_MIDDLE = "off_middle"
    """The gel is touched too far from the field's middle, and the arm may follow."""
    NO_ONSET = "no_onset"
    CENTRED = "centred"
    REACHED = "reached"
    SETTLED = "settled"
    CAPTURED = "captured"
    LAST_CAPTURED = "last_captured"
    """The images of the recipe's last step, or of the last that its closing limit allows, were taken."""
    MEASURED = "measured"
    EARLY_STOP = "early_stop"
    """The image was measured, and `judge.early_stop` says that no further step is to be made."""
    JUDGED_ACCEPT = "judged_accept"
    JUDGED_REJECT = "judged_reject"
    """FAIL or NO_RESULT."""
    PRESS_AGAIN = "press_again"
    """The press was inconclusive, and the recipe lets the fruit be pressed once more."""
    RECORDED = "recorded"
    PLACED = "placed"
    """The fruit lies where it belongs, and the jaws are wider than any fruit that the recipe expects."""
    JAWS_OPEN = "jaws_open"
    HOME = "home"
    UNFINISHED_CLOSED = "unfinished_closed"
    RESET = "reset"
    """By the PLC's command, at the panel, or by the service itself where the settings let it."""
    STOP = "stop"
    """An orderly stop; `CHECK_DEVICES` repeats it while it is in force."""
    CALLED_OFF = "called_off"
    LATE = "late"
    """The inspection's deadline passed. A single wait's deadline is the device's fault."""
    ARM_FAULT = "arm_fault"
    GRIPPER_FAULT = "gripper_fault"
    CAMERA_FAULT = "camera_fault"
    RECORDS_FAULT = "records_fault"
    INTERNAL_FAULT = "internal_fault"
    PROTECTIVE_STOP = "protective_stop"
    EMERGENCY_STOP = "emergency_stop"
    SAFETY_FAULT = "safety_fault"
    PROGRAM_STOPPED = "program_stopped"
    """A person stopped the arm's program on the pendant."""
    PERSON_CONFIRMED = "person_confirmed"
    """A person at the panel says that the cell is safe and the jaws are clear."""
    RECOVERED = "recovered"
    FRUIT_HELD = "fruit_held"
    """The process before ended with a judged fruit that may be between the jaws: see `hold_after`."""


class Action(StrEnum):
    """Action of the service, with the events that end it, besides faults."""

    READ_DEVICES = "read_devices"
    """Read every device until all answer: READY, or the active stop."""
    CLOSE_UNFINISHED = "close_unfinished"
    """Give every accepted trigger that has no durable outcome its NO_RESULT, durable, and publish every outcome that
    was not: UNFINISHED_CLOSED. Idempotent."""
    OPEN_JAWS = "open_jaws"
    """JAWS_OPEN. Idempotent."""
    FREE_FRUIT = "free_fruit"
    """Open only so far that the sensor can move beside the fruit: JAWS_OPEN. Idempotent."""
    GO_HOME = "go_home"
    """Bring the arm to where it waits, and open the jaws fully meanwhile: HOME. Idempotent."""
    CHECK_DEVICES = "check_devices"
    """Read the known health, without waiting: READY, STOP where one was requested, or what is wrong."""
    RECORD_TRIGGER = "record_trigger"
    """TRIGGER_RECORDED."""
    REFUSE_TRIGGER = "refuse_trigger"
    """Answer the trigger under way with a refusal and take its record back."""
    ACCEPT_TRIGGER = "accept_trigger"
    """Answer the trigger: an inspection has begun. Its deadline starts."""
    CHECK_JAWS = "check_jaws"
    """Make sure that the jaws are fully open, so that nothing touches the gel: JAWS_OPEN, or REFERENCE_BAD."""
    APPROACH = "approach"
    """Go to the fruit, and take the reference on the way: ARRIVED, or REFERENCE_BAD."""
    CLOSE_TO_ONSET = "close_to_onset"
    """ONSET_FOUND, OFF_MIDDLE or NO_ONSET."""
    CENTRE = "centre"
    """Go to where the contact will be in the field's middle: CENTRED. On a bench without an arm at once."""
    CLOSE_STEP = "close_step"
    """REACHED."""
    SETTLE = "settle"
    """SETTLED."""
    CAPTURE = "capture"
    """CAPTURED or LAST_CAPTURED."""
    MEASURE = "measure"
    """Measure the captured image that is next in order: MEASURED or EARLY_STOP."""
    HALT = "halt"
    """Stop arm and gripper where they are and forget what was under way, but for a write: its events come no more."""
    JUDGE = "judge"
    """Judge all presses so far together: JUDGED_ACCEPT, JUDGED_REJECT or PRESS_AGAIN."""
    CLOSE_AS_NO_RESULT = "close_as_no_result"
    """The outcome is NO_RESULT, with the reason of the event and what was measured so far."""
    RECORD = "record"
    """Make the outcome durable: RECORDED."""
    PUBLISH = "publish"
    """Pass the recorded outcome to the callers that wait for it now or later; the action does not wait for them."""
    PLACE_ACCEPT = "place_accept"
    """PLACED: carried to the accept place, or left in the nest where the line itself diverts; the jaws open."""
    PLACE_REJECT = "place_reject"
    """PLACED, likewise."""
    RECOVER_ARM = "recover_arm"
    """Leave the safety stop that the person has confirmed: RECOVERED."""


class Raise(NamedTuple):
    """Raise an alarm."""

    alarm: AlarmId


Act = Action | Raise


class Transition(NamedTuple):
    """Next state, and the actions in their order."""

    state: State
    actions: tuple[Act, ...] = ()


class Row(NamedTuple):
    """Some states in which some events lead to one state with the same actions."""

    states: tuple[State, ...]
    events: tuple[Event, ...]
    next: State | None
    """None for the same state again."""
    actions: tuple[Act, ...] = ()


START = Transition(State.UNKNOWN, (Action.READ_DEVICES,))
"""How a process begins where no hold was stored: nothing is known of devices and fruit until they were read."""

REASONS: dict[Event, Reason] = {
    Event.NO_ONSET: Reason.NO_CONTACT,
    Event.REFERENCE_BAD: Reason.REFERENCE_BAD,
    Event.CALLED_OFF: Reason.CALLED_OFF,
    Event.STOP: Reason.CALLED_OFF,
    Event.LATE: Reason.LATE,
    Event.ARM_FAULT: Reason.ARM_FAULT,
    Event.GRIPPER_FAULT: Reason.GRIPPER_FAULT,
    Event.CAMERA_FAULT: Reason.CAMERA_FAULT,
    Event.RECORDS_FAULT: Reason.RECORDS_FAULT,
    Event.INTERNAL_FAULT: Reason.INTERNAL_FAULT,
    Event.PROTECTIVE_STOP: Reason.ARM_FAULT,
    Event.EMERGENCY_STOP: Reason.ARM_FAULT,
    Event.SAFETY_FAULT: Reason.ARM_FAULT,
    Event.PROGRAM_STOPPED: Reason.ARM_FAULT,
}
"""The outcome's reason where an event closes an inspection as NO_RESULT."""

S, E, A = State, Event, Action

MEASURING = (S.MOVING_MEASURING, S.SETTLING_MEASURING, S.CAPTURING_MEASURING)
CAPTURED_ALL = (S.AWAITING_MEASURE_LAST, S.MEASURING_LAST, S.JUDGING)
BEFORE_LAST_IMAGE = (
    S.RETREATING_ACCEPTED,
    S.REFERENCE,
    S.APPROACHING,
    S.CLOSING_TO_ONSET,
    S.MOVING,
    S.SETTLING,
    S.CAPTURING,
    *MEASURING,
    S.AWAITING_MEASURE,
    S.OPENING_AGAIN,
    S.CENTRING,
)
UNJUDGED = (*BEFORE_LAST_IMAGE, *CAPTURED_ALL)
RECORDING = (S.RECORDING_ACCEPT, S.RECORDING_REJECT, S.RECORDING_RELEASE)
PLACING = (S.PLACING_ACCEPT, S.PLACING_REJECT)
STOPPED_FOR_A_PERSON = (S.RECORDING_LATCHED, S.LATCHED, S.RECOVERING)
LEAVING = (S.RETREATING, S.RETREATING_READY)
ACCEPTING = (S.ACCEPTING, S.RETREATING_ACCEPTING)
UNRECORDED = (S.OPENING_UNRECORDED, S.HOMING_UNRECORDED)
GETTING_READY = (S.CLEARING, S.RESETTING, S.HOMING, S.CHECKING)
WAITING = (S.UNKNOWN, S.STOPPED, S.HELD, S.CARRIED, S.LATCHED)
WAITING_FOR_DEVICES = (S.UNKNOWN, S.HELD)

MOTION_FAULTS = (E.ARM_FAULT, E.GRIPPER_FAULT)
FAULTS = (*MOTION_FAULTS, E.CAMERA_FAULT, E.RECORDS_FAULT, E.INTERNAL_FAULT)
LATCHES = {
    E.PROTECTIVE_STOP: AlarmId.PROTECTIVE_STOP,
    E.EMERGENCY_STOP: AlarmId.EMERGENCY_STOP,
    E.SAFETY_FAULT: AlarmId.SAFETY_FAULT,
    E.PROGRAM_STOPPED: AlarmId.ARM_NOT_REMOTE,
}
_NO_RESULT = (A.HALT, A.CLOSE_AS_NO_RESULT, A.RECORD)
_HOLD = (A.HALT, A.READ_DEVICES)


def _latched() -> Iterable[Row]:
    """The stops that a person has to confirm: nothing moves any more, and what is open becomes NO_RESULT."""
    for event, alarm in LATCHES.items():
        raised, stopped = Raise(alarm), (A.HALT, Raise(alarm))
        yield Row(UNJUDGED, (event,), S.RECORDING_LATCHED, (*_NO_RESULT, raised))
        yield Row((*RECORDING, S.RECORDING_HELD), (event,), S.RECORDING_LATCHED, stopped)
        yield Row((*PLACING, S.RELEASING, *LEAVING, S.OPENING_HELD), (event,), S.LATCHED, stopped)
        yield Row((*UNRECORDED, *GETTING_READY, S.RECOVERING), (event,), S.LATCHED, stopped)
        yield Row(ACCEPTING, (event,), S.LATCHED, (A.REFUSE_TRIGGER, *stopped))
        yield Row((S.UNKNOWN, S.STOPPED, S.IDLE, S.HELD, S.CARRIED), (event,), S.LATCHED, stopped)
        # A further stop while one is active has an alarm of its own.
        yield Row((S.RECORDING_LATCHED, S.LATCHED), (event,), None, (raised,))


ROWS: tuple[Row, ...] = (
    # From a start, or after a fault, to the first trigger.
    Row(WAITING_FOR_DEVICES, (E.READY,), S.CLEARING, (A.CLOSE_UNFINISHED,)),
    Row((S.CLEARING,), (E.UNFINISHED_CLOSED,), S.STOPPED),
    Row((S.STOPPED,), (E.RESET,), S.RESETTING, (A.OPEN_JAWS,)),
    Row((S.RESETTING,), (E.JAWS_OPEN,), S.HOMING, (A.GO_HOME,)),
    Row((S.HOMING,), (E.HOME,), S.CHECKING, (A.CHECK_DEVICES,)),
    Row((S.CHECKING,), (E.READY,), S.IDLE),
    Row((S.IDLE,), (E.TRIGGER,), S.ACCEPTING, (A.RECORD_TRIGGER,)),
    Row((S.ACCEPTING,), (E.TRIGGER_RECORDED,), S.REFERENCE, (A.ACCEPT_TRIGGER, A.CHECK_JAWS)),
    # The inspection; an image is measured while the next step is made.
    Row((S.REFERENCE,), (E.JAWS_OPEN,), S.APPROACHING, (A.APPROACH,)),
    Row((S.APPROACHING,), (E.ARRIVED,), S.CLOSING_TO_ONSET, (A.CLOSE_TO_ONSET,)),
    Row((S.CLOSING_TO_ONSET,), (E.ONSET_FOUND,), S.MOVING, (A.CLOSE_STEP,)),
    Row((S.MOVING,), (E.REACHED,), S.SETTLING, (A.SETTLE,)),
    Row((S.SETTLING,), (E.SETTLED,), S.CAPTURING, (A.CAPTURE,)),
    Row((S.CAPTURING,), (E.CAPTURED,), S.MOVING_MEASURING, (A.MEASURE, A.CLOSE_STEP)),
    Row((S.CAPTURING,), (E.LAST_CAPTURED,), S.MEASURING_LAST, (A.MEASURE,)),
    Row((S.MOVING_MEASURING,), (E.REACHED,), S.SETTLING_MEASURING, (A.SETTLE,)),
    Row((S.SETTLING_MEASURING,), (E.SETTLED,), S.CAPTURING_MEASURING, (A.CAPTURE,)),
    Row((S.CAPTURING_MEASURING,), (E.CAPTURED,), S.AWAITING_MEASURE),
    Row((S.CAPTURING_MEASURING,), (E.LAST_CAPTURED,), S.AWAITING_MEASURE_LAST),
    Row((S.MOVING_MEASURING,), (E.MEASURED,), S.MOVING),
    Row((S.SETTLING_MEASURING,), (E.MEASURED,), S.SETTLING),
    Row((S.CAPTURING_MEASURING,), (E.MEASURED,), S.CAPTURING),
    Row((S.AWAITING_MEASURE,), (E.MEASURED,), S.MOVING_MEASURING, (A.MEASURE, A.CLOSE_STEP)),
    Row((S.AWAITING_MEASURE_LAST,), (E.MEASURED,), S.MEASURING_LAST, (A.MEASURE,)),
    Row((S.MEASURING_LAST,), (E.MEASURED, E.EARLY_STOP), S.JUDGING, (A.JUDGE,)),
    Row((*MEASURING, S.AWAITING_MEASURE, S.AWAITING_MEASURE_LAST), (E.EARLY_STOP,), S.JUDGING, (A.HALT, A.JUDGE)),
    Row((S.CLOSING_TO_ONSET,), (E.OFF_MIDDLE,), S.OPENING_AGAIN, (A.FREE_FRUIT,)),
    Row((S.JUDGING,), (E.PRESS_AGAIN,), S.OPENING_AGAIN, (A.FREE_FRUIT,)),
    Row((S.OPENING_AGAIN,), (E.JAWS_OPEN,), S.CENTRING, (A.CENTRE,)),
    Row((S.CENTRING,), (E.CENTRED,), S.CLOSING_TO_ONSET, (A.CLOSE_TO_ONSET,)),
    Row((S.JUDGING,), (E.JUDGED_ACCEPT,), S.RECORDING_ACCEPT, (A.RECORD,)),
    Row((S.JUDGING,), (E.JUDGED_REJECT,), S.RECORDING_REJECT, (A.RECORD,)),
    Row((S.RECORDING_ACCEPT,), (E.RECORDED,), S.PLACING_ACCEPT, (A.PUBLISH, A.PLACE_ACCEPT)),
    Row((S.RECORDING_REJECT,), (E.RECORDED,), S.PLACING_REJECT, (A.PUBLISH, A.PLACE_REJECT)),
    Row(PLACING, (E.PLACED,), S.RETREATING_READY, (A.GO_HOME,)),
    Row((S.RETREATING,), (E.HOME,), S.CHECKING, (A.CHECK_DEVICES,)),
    # Checked while triggers are accepted: a readiness that the PLC has seen does not go away for a moment.
    Row((S.RETREATING_READY,), (E.HOME,), S.IDLE, (A.CHECK_DEVICES,)),
    Row((S.IDLE, S.ACCEPTING), (E.READY,), None),
    # The next trigger comes while the arm still leaves: it is accepted, and waits for the arm.
    Row((S.RETREATING_READY,), (E.TRIGGER,), S.RETREATING_ACCEPTING, (A.RECORD_TRIGGER,)),
    Row((S.RETREATING_ACCEPTING,), (E.HOME,), S.ACCEPTING),
    Row((S.RETREATING_ACCEPTING,), (E.TRIGGER_RECORDED,), S.RETREATING_ACCEPTED, (A.ACCEPT_TRIGGER,)),
    Row((S.RETREATING_ACCEPTED,), (E.HOME,), S.REFERENCE, (A.CHECK_JAWS,)),
    Row((S.RETREATING_READY,), (E.CAMERA_FAULT, E.RECORDS_FAULT, E.STOP), S.RETREATING),
    Row((S.RETREATING_ACCEPTING,), (E.STOP,), S.RETREATING, (A.REFUSE_TRIGGER,)),
    # It cannot be judged, and the arm can still move: the fruit is let go where it is.
    Row((S.REFERENCE, S.APPROACHING), (E.REFERENCE_BAD,), S.RECORDING_RELEASE, _NO_RESULT),
    Row((S.CLOSING_TO_ONSET,), (E.NO_ONSET,), S.RECORDING_RELEASE, _NO_RESULT),
    Row(BEFORE_LAST_IMAGE, (E.CAMERA_FAULT, E.STOP), S.RECORDING_RELEASE, _NO_RESULT),
    Row(UNJUDGED, (E.CALLED_OFF, E.RECORDS_FAULT, E.INTERNAL_FAULT), S.RECORDING_RELEASE, _NO_RESULT),
    Row(UNJUDGED, (E.LATE,), S.RECORDING_RELEASE, (*_NO_RESULT, Raise(AlarmId.DEADLINE_MISSED))),
    Row((S.RECORDING_RELEASE,), (E.RECORDED,), S.RELEASING, (A.PUBLISH, A.OPEN_JAWS)),
    Row((S.RELEASING,), (E.JAWS_OPEN,), S.RETREATING, (A.GO_HOME,)),
    # The arm or the gripper fails: the jaws open if they can, and the arm stays until it was read again.
    Row(UNJUDGED, MOTION_FAULTS, S.RECORDING_HELD, _NO_RESULT),
    Row((S.RECORDING_HELD,), (E.RECORDED,), S.OPENING_HELD, (A.PUBLISH, A.OPEN_JAWS)),
    Row((S.RECORDING_HELD,), (E.RECORDS_FAULT, E.INTERNAL_FAULT), S.OPENING_HELD, (A.OPEN_JAWS,)),
    Row((S.OPENING_HELD,), (E.JAWS_OPEN, E.GRIPPER_FAULT, E.INTERNAL_FAULT), S.HELD, _HOLD),
    Row((S.RELEASING, *LEAVING), (*MOTION_FAULTS, E.INTERNAL_FAULT), S.HELD, _HOLD),
    # The fruit may still be between the jaws, anywhere on the way to its place: a person has to take it out.
    Row(PLACING, (*MOTION_FAULTS, E.INTERNAL_FAULT), S.CARRIED, (A.HALT, Raise(AlarmId.FRUIT_HELD))),
    # The outcome cannot be made durable: it is not published, and is closed as NO_RESULT once the records are back.
    Row(RECORDING, (E.RECORDS_FAULT, E.INTERNAL_FAULT), S.OPENING_UNRECORDED, (A.OPEN_JAWS,)),
    Row((S.OPENING_UNRECORDED,), (E.JAWS_OPEN,), S.HOMING_UNRECORDED, (A.GO_HOME,)),
    Row((S.HOMING_UNRECORDED,), (E.HOME,), S.HELD, _HOLD),
    Row(UNRECORDED, (*MOTION_FAULTS, E.INTERNAL_FAULT), S.HELD, _HOLD),
    # Outside an inspection.
    Row((*GETTING_READY, S.IDLE), FAULTS, S.HELD, _HOLD),
    Row(ACCEPTING, FAULTS, S.HELD, (A.REFUSE_TRIGGER, *_HOLD)),
    Row((S.ACCEPTING,), (E.STOP,), S.STOPPED, (A.REFUSE_TRIGGER,)),
    Row((S.RESETTING, S.HOMING, S.CHECKING, S.IDLE), (E.STOP,), S.STOPPED, (A.HALT,)),
    # A person's part.
    Row((S.RECORDING_LATCHED,), (E.RECORDED,), S.LATCHED, (A.PUBLISH,)),
    Row((S.RECORDING_LATCHED,), (E.RECORDS_FAULT, E.INTERNAL_FAULT), S.LATCHED),
    Row((S.LATCHED,), (E.PERSON_CONFIRMED,), S.RECOVERING, (A.RECOVER_ARM,)),
    Row((S.RECOVERING,), (E.RECOVERED,), S.UNKNOWN, (A.READ_DEVICES,)),
    Row((S.RECOVERING,), (*MOTION_FAULTS, E.INTERNAL_FAULT), S.LATCHED),
    Row((S.UNKNOWN,), (E.FRUIT_HELD,), S.CARRIED, (A.HALT, Raise(AlarmId.FRUIT_HELD))),
    Row((S.CARRIED,), (E.PERSON_CONFIRMED,), S.UNKNOWN, (A.READ_DEVICES,)),
    *_latched(),
    # What is expected and changes nothing: a wait is going on, or CHECKING will ask again.
    Row(WAITING, (*FAULTS, E.STOP), None),
    Row((*CAPTURED_ALL, *RECORDING, *PLACING, S.RELEASING, S.RETREATING), (E.CAMERA_FAULT, E.STOP), None),
    Row((*PLACING, S.RELEASING, S.RETREATING, S.OPENING_HELD, *UNRECORDED), (E.RECORDS_FAULT,), None),
    Row((*RECORDING, S.RECORDING_HELD, S.RECORDING_LATCHED), MOTION_FAULTS, None),
    Row((S.RECORDING_HELD, S.RECORDING_LATCHED, S.OPENING_HELD, *UNRECORDED), (E.CAMERA_FAULT, E.STOP), None),
    Row((S.OPENING_HELD,), (E.ARM_FAULT,), None),
    Row((S.RECOVERING,), (E.CAMERA_FAULT, E.RECORDS_FAULT, E.STOP), None),
    Row((S.CLEARING,), (E.STOP,), None),
    Row(RECORDING, (E.LATE,), None, (Raise(AlarmId.DEADLINE_MISSED),)),
)


def _table(rows: Iterable[Row]) -> dict[tuple[State, Event], Transition]:
    table: dict[tuple[State, Event], Transition] = {}
    for row in rows:
        for state in row.states:
            for event in row.events:
                if (state, event) in table:
                    raise ValueError(f"two rows for {state} and {event}")
                table[state, event] = Transition(row.next or state, row.actions)
    return table


TABLE: dict[tuple[State, Event], Transition] = _table(ROWS)


def hold_after(event: Event, state: State, before: Event | None, *, carries: bool) -> Event | None:
    """Return the hold to store before a state is shown, so that only a person can continue after a crash.

    Args:
        event: what led to the state.
        before: what was durable until then.
        carries: the arm carries judged fruit to their places; a killed process then leaves one between the jaws.

    Returns:
        The event that the next process begins with, in place of `START`; None where no person is needed.
    """
    if state is S.CARRIED or (carries and state in PLACING):
        return E.FRUIT_HELD
    if state in STOPPED_FOR_A_PERSON:
        # What else happens there, such as RECORDED, does not end the stop that was stored.
        return event if event in LATCHES else before
    return None


class Cycle:
    """State of one station's cycle, and counts of refused events.

    Args:
        hold: what `hold_after` gave last in the process before.
    """

    def __init__(self, hold: Event | None = None) -> None:
        self.begin = START if hold is None else TABLE[START.state, hold]
        """Where it begins, and what is to be done first."""
        self.state = self.begin.state
        self.refused: Counter[tuple[State, Event]] = Counter()
        """How often an event came in a state that has no row for it."""

    @property
    def facts(self) -> StateFacts:
        """Facts of the present state for the PLC and the operator."""
        return STATES[self.state]

    def leads_to(self, event: Event) -> Transition | None:
        """Return the transition that an event would cause now, with nothing changed; None where it would be refused."""
        return TABLE.get((self.state, event))

    def on(self, event: Event) -> tuple[Act, ...] | None:
        """Take an event; never raises.

        Returns:
            What is to be done, in this order; None where the event is refused, which is counted.
        """
        transition = self.leads_to(event)
        if transition is None:
            self.refused[self.state, event] += 1
            return None
        self.state = transition.state
        return transition.actions
