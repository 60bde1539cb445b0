"""The cycle's states: what each is to the line's PLC, and whether a trigger is accepted in it."""

from enum import StrEnum
from typing import NamedTuple

from station.messages import states as texts
from station.messages.message import Definition, Message, joined
from station.vocabulary import PackmlState, Refusal


class State(StrEnum):
    """State of the cycle. `X_MEASURING` is `X` while the step before is being measured."""

    UNKNOWN = "unknown"
    CLEARING = "clearing"
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
    """Facts of a state for the PLC and the operator."""

    packml: PackmlState | None
    """None while it is unknown."""
    refusal: Refusal | None
    """Why a trigger is not accepted; None where it is."""
    text: Definition
    """The activity, and where a trigger is not accepted what ends it."""
    needs_person: bool = False
    """Nothing but a person's confirmation leads on."""
    may_exit: bool = False
    """The process may end here: no inspection is under way."""

    @property
    def activity(self) -> Message:
        """Description of the activity in the state."""
        return self.text()

    @property
    def reason(self) -> Message:
        """The same for a caller that waits: during an inspection also that it has to end."""
        return joined((self.activity, texts.WAIT())) if self.refusal is Refusal.BUSY else self.activity


def _inspecting(text: Definition, packml: PackmlState = PackmlState.EXECUTE) -> StateFacts:
    return StateFacts(packml, Refusal.BUSY, text)


def _not_ready(
    text: Definition, packml: PackmlState | None, *, needs_person: bool = False, may_exit: bool = False
) -> StateFacts:
    return StateFacts(packml, Refusal.NOT_READY, text, needs_person, may_exit)


STATES: dict[State, StateFacts] = {
    State.UNKNOWN: _not_ready(texts.UNKNOWN, None, may_exit=True),
    State.CLEARING: _not_ready(texts.CLEARING, PackmlState.CLEARING),
    State.STOPPED: _not_ready(texts.STOPPED, PackmlState.STOPPED, may_exit=True),
    State.RESETTING: _not_ready(texts.RESETTING, PackmlState.RESETTING),
    State.HOMING: _not_ready(texts.HOMING, PackmlState.RESETTING),
    State.CHECKING: _not_ready(texts.CHECKING, PackmlState.RESETTING),
    State.IDLE: StateFacts(PackmlState.IDLE, None, texts.IDLE, may_exit=True),
    State.ACCEPTING: _inspecting(texts.ACCEPTING, PackmlState.STARTING),
    State.REFERENCE: _inspecting(texts.REFERENCE),
    State.APPROACHING: _inspecting(texts.APPROACHING),
    State.CLOSING_TO_ONSET: _inspecting(texts.CLOSING_TO_ONSET),
    State.MOVING: _inspecting(texts.MOVING),
    State.SETTLING: _inspecting(texts.SETTLING),
    State.CAPTURING: _inspecting(texts.CAPTURING),
    State.MOVING_MEASURING: _inspecting(texts.MOVING_MEASURING),
    State.SETTLING_MEASURING: _inspecting(texts.SETTLING_MEASURING),
    State.CAPTURING_MEASURING: _inspecting(texts.CAPTURING_MEASURING),
    State.AWAITING_MEASURE: _inspecting(texts.AWAITING_MEASURE),
    State.AWAITING_MEASURE_LAST: _inspecting(texts.AWAITING_MEASURE_LAST),
    State.MEASURING_LAST: _inspecting(texts.MEASURING_LAST),
    State.JUDGING: _inspecting(texts.JUDGING),
    State.OPENING_AGAIN: _inspecting(texts.OPENING_AGAIN),
    State.CENTRING: _inspecting(texts.CENTRING),
    State.RECORDING_ACCEPT: _inspecting(texts.RECORDING_ACCEPT),
    State.RECORDING_REJECT: _inspecting(texts.RECORDING_REJECT),
    State.RECORDING_RELEASE: _inspecting(texts.RECORDING_RELEASE),
    State.PLACING_ACCEPT: _inspecting(texts.PLACING_ACCEPT),
    State.PLACING_REJECT: _inspecting(texts.PLACING_REJECT),
    State.RELEASING: _inspecting(texts.RELEASING),
    State.RETREATING: _inspecting(texts.RETREATING, PackmlState.COMPLETING),
    State.RETREATING_READY: StateFacts(PackmlState.COMPLETING, None, texts.RETREATING_READY),
    State.RETREATING_ACCEPTING: _inspecting(texts.RETREATING_ACCEPTING, PackmlState.STARTING),
    State.RETREATING_ACCEPTED: _inspecting(texts.RETREATING_ACCEPTED),
    State.RECORDING_HELD: _inspecting(texts.RECORDING_HELD, PackmlState.HOLDING),
    State.OPENING_HELD: _not_ready(texts.OPENING_HELD, PackmlState.HOLDING),
    State.OPENING_UNRECORDED: _not_ready(texts.OPENING_UNRECORDED, PackmlState.HOLDING),
    State.HOMING_UNRECORDED: _not_ready(texts.HOMING_UNRECORDED, PackmlState.HOLDING),
    State.HELD: _not_ready(texts.HELD, PackmlState.HELD, may_exit=True),
    State.CARRIED: _not_ready(texts.CARRIED, PackmlState.HELD, needs_person=True, may_exit=True),
    State.RECORDING_LATCHED: _inspecting(texts.RECORDING_LATCHED, PackmlState.ABORTING),
    State.LATCHED: _not_ready(texts.LATCHED, PackmlState.ABORTED, needs_person=True, may_exit=True),
    State.RECOVERING: _not_ready(texts.RECOVERING, PackmlState.CLEARING),
}
