"""The cycle's states: what each is to the line's PLC, and whether a trigger is accepted in it."""

from enum import StrEnum
from typing import NamedTuple

from station.vocabulary import PackmlState, Refusal


class State(StrEnum):
    """Where the cycle is. `…_MEASURING` is the same as without it while the image of the step before is measured."""

    UNKNOWN = "unknown"
    CLEARING = "clearing"
    OPENING_TO_CLEAR = "opening_to_clear"
    STOPPED = "stopped"
    RESETTING = "resetting"
    HOMING = "homing"
    CHECKING = "checking"
    IDLE = "idle"
    ACCEPTING = "accepting"
    REFERENCE = "reference"
    APPROACHING = "approaching"
    CLOSING_TO_ONSET = "closing_to_onset"
    MOVING = "moving"
    SETTLING = "settling"
    CAPTURING = "capturing"
    MOVING_MEASURING = "moving_measuring"
    SETTLING_MEASURING = "settling_measuring"
    CAPTURING_MEASURING = "capturing_measuring"
    AWAITING_MEASURE = "awaiting_measure"
    AWAITING_MEASURE_LAST = "awaiting_measure_last"
    MEASURING_LAST = "measuring_last"
    JUDGING = "judging"
    OPENING_AGAIN = "opening_again"
    CENTRING = "centring"
    RECORDING_ACCEPT = "recording_accept"
    RECORDING_REJECT = "recording_reject"
    RECORDING_RELEASE = "recording_release"
    PLACING_ACCEPT = "placing_accept"
    PLACING_REJECT = "placing_reject"
    RELEASING = "releasing"
    RETREATING = "retreating"
    RETREATING_READY = "retreating_ready"
    """Fruit and jaws are free, so that the next trigger is accepted already."""
    RETREATING_ACCEPTING = "retreating_accepting"
    RETREATING_ACCEPTED = "retreating_accepted"
    RECORDING_HELD = "recording_held"
    OPENING_HELD = "opening_held"
    OPENING_UNRECORDED = "opening_unrecorded"
    HOMING_UNRECORDED = "homing_unrecorded"
    HELD = "held"
    CARRIED = "carried"
    RECORDING_LATCHED = "recording_latched"
    LATCHED = "latched"
    RECOVERING = "recovering"


class StateFacts(NamedTuple):
    """What a state means outside."""

    packml: PackmlState | None
    """None while it is unknown."""
    refusal: Refusal | None
    """Why a trigger is not accepted; None where it is."""
    sentence: str
    """What is going on, and where a trigger is not accepted what ends it."""
    needs_person: bool = False
    """Nothing but a person's confirmation leads on."""
    may_exit: bool = False
    """The process may end here: no inspection is under way."""


_BUSY = "Wait until the station is ready again."


def _inspecting(what: str, packml: PackmlState = PackmlState.EXECUTE) -> StateFacts:
    return StateFacts(packml, Refusal.BUSY, f"{what} {_BUSY}")


def _preparing(what: str, packml: PackmlState) -> StateFacts:
    return StateFacts(packml, Refusal.NOT_READY, what)


STATES: dict[State, StateFacts] = {
    State.UNKNOWN: StateFacts(
        None,
        Refusal.NOT_READY,
        "The state of devices and fruit is not known yet; it goes on once every device answers: see the alarms.",
        may_exit=True,
    ),
    State.CLEARING: _preparing(
        "What was left open is closed with NO_RESULT and made durable; wait a moment.", PackmlState.CLEARING
    ),
    State.OPENING_TO_CLEAR: _preparing("The jaws open; wait a moment.", PackmlState.CLEARING),
    State.STOPPED: StateFacts(
        PackmlState.STOPPED,
        Refusal.NOT_READY,
        "The station is stopped; reset it by the PLC's command or at the panel.",
        may_exit=True,
    ),
    State.RESETTING: _preparing("The jaws open before the arm goes home; wait a moment.", PackmlState.RESETTING),
    State.HOMING: _preparing("The arm goes home; wait a moment.", PackmlState.RESETTING),
    State.CHECKING: _preparing("Every device's health is looked at; wait a moment.", PackmlState.RESETTING),
    State.IDLE: StateFacts(PackmlState.IDLE, None, "Ready for a trigger.", may_exit=True),
    State.ACCEPTING: _inspecting("A trigger is made durable.", PackmlState.STARTING),
    State.REFERENCE: _inspecting("The jaws are checked to be open, so that nothing touches the gel."),
    State.APPROACHING: _inspecting("The arm goes to the fruit; the reference is taken on the way."),
    State.CLOSING_TO_ONSET: _inspecting("The jaws close until the gel is touched."),
    State.MOVING: _inspecting("The jaws close by a step."),
    State.SETTLING: _inspecting("The fruit settles."),
    State.CAPTURING: _inspecting("Images of the step are taken."),
    State.MOVING_MEASURING: _inspecting("The jaws close by a step."),
    State.SETTLING_MEASURING: _inspecting("The fruit settles."),
    State.CAPTURING_MEASURING: _inspecting("Images of the step are taken."),
    State.AWAITING_MEASURE: _inspecting("The jaws wait for the measurement of the step before."),
    State.AWAITING_MEASURE_LAST: _inspecting("All images are taken; the last but one is measured."),
    State.MEASURING_LAST: _inspecting("All images are taken; the last is measured."),
    State.JUDGING: _inspecting("The curve is judged."),
    State.OPENING_AGAIN: _inspecting("The jaws open, to close on the fruit once more."),
    State.CENTRING: _inspecting("The arm goes to where the contact will be in the field's middle."),
    State.RECORDING_ACCEPT: _inspecting("PASS is made durable."),
    State.RECORDING_REJECT: _inspecting("FAIL or NO_RESULT is made durable."),
    State.RECORDING_RELEASE: _inspecting("NO_RESULT is made durable."),
    State.PLACING_ACCEPT: _inspecting("The fruit goes where good fruit goes."),
    State.PLACING_REJECT: _inspecting("The fruit goes where rejected fruit goes."),
    State.RELEASING: _inspecting("The jaws open and leave the fruit where it is."),
    State.RETREATING: _inspecting("The arm leaves the nest.", PackmlState.COMPLETING),
    State.RETREATING_READY: StateFacts(
        PackmlState.COMPLETING, None, "The arm leaves the nest; the next trigger is accepted already."
    ),
    State.RETREATING_ACCEPTING: _inspecting(
        "A trigger is made durable while the arm leaves the nest.", PackmlState.STARTING
    ),
    State.RETREATING_ACCEPTED: _inspecting("The next inspection begins once the arm has left the nest."),
    State.RECORDING_HELD: _inspecting("A device failed; NO_RESULT is made durable.", PackmlState.HOLDING),
    State.OPENING_HELD: _preparing("A device failed; the jaws open if they can.", PackmlState.HOLDING),
    State.OPENING_UNRECORDED: _preparing("The outcome could not be made durable; the jaws open.", PackmlState.HOLDING),
    State.HOMING_UNRECORDED: _preparing(
        "The outcome could not be made durable; the arm goes home.", PackmlState.HOLDING
    ),
    State.HELD: StateFacts(
        PackmlState.HELD,
        Refusal.NOT_READY,
        "Something that an inspection needs is away: do what its alarm says. The station goes on by itself once it "
        "is back.",
        may_exit=True,
    ),
    State.CARRIED: StateFacts(
        PackmlState.HELD,
        Refusal.NOT_READY,
        "A judged fruit may still be between the jaws: take it out, mend what the alarms say, then confirm at the "
        "panel.",
        needs_person=True,
        may_exit=True,
    ),
    State.RECORDING_LATCHED: _inspecting("A safety stop stands; NO_RESULT is made durable.", PackmlState.ABORTING),
    State.LATCHED: StateFacts(
        PackmlState.ABORTED,
        Refusal.NOT_READY,
        "A safety stop stands: make the cell safe, mend its cause, take out what is between the jaws, then confirm "
        "at the panel.",
        needs_person=True,
        may_exit=True,
    ),
    State.RECOVERING: _preparing(
        "The arm is brought back after a person's confirmation; wait a moment.", PackmlState.CLEARING
    ),
}
