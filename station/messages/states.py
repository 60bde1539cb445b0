"""Messages of the cycle's states: what the station is doing, and what ends it where a trigger is not accepted."""

from station.messages.message import define

WAIT = define("state.wait", "Wait until the station is ready again.")
UNKNOWN = define(
    "state.unknown",
    "The state of devices and fruit is not known yet; the station continues once every device answers: see the alarms.",
)
CLEARING = define("state.clearing", "What was left open is closed with NO_RESULT and stored; wait a moment.")
STOPPED = define("state.stopped", "The station is stopped; reset it by the PLC's command or at the panel.")
RESETTING = define("state.resetting", "The jaws open before the arm goes home; wait a moment.")
HOMING = define("state.homing", "The arm goes home; wait a moment.")
CHECKING = define("state.checking", "The health of every device is checked; wait a moment.")
IDLE = define("state.idle", "Ready for a trigger.")
ACCEPTING = define("state.accepting", "A trigger is stored.")
REFERENCE = define("state.reference", "The jaws are checked to be open: nothing may touch the gel.")
APPROACHING = define("state.approaching", "The arm goes to the fruit; the reference is taken on the way.")
CLOSING_TO_ONSET = define("state.closing_to_onset", "The jaws close until the gel is touched.")
MOVING = define("state.moving", "The jaws close by a step.")
SETTLING = define("state.settling", "The fruit settles.")
CAPTURING = define("state.capturing", "Images of the step are taken.")
MOVING_MEASURING = define("state.moving_measuring", "The jaws close by a step.")
SETTLING_MEASURING = define("state.settling_measuring", "The fruit settles.")
CAPTURING_MEASURING = define("state.capturing_measuring", "Images of the step are taken.")
AWAITING_MEASURE = define("state.awaiting_measure", "The jaws wait for the measurement of the step before.")
AWAITING_MEASURE_LAST = define("state.awaiting_measure_last", "All images are taken; the last but one is measured.")
MEASURING_LAST = define("state.measuring_last", "All images are taken; the last is measured.")
JUDGING = define("state.judging", "The curve is judged.")
OPENING_AGAIN = define("state.opening_again", "The jaws open, to close on the fruit once more.")
CENTRING = define("state.centring", "The arm goes to where the contact will be in the field's middle.")
RECORDING_ACCEPT = define("state.recording_accept", "PASS is stored.")
RECORDING_REJECT = define("state.recording_reject", "FAIL or NO_RESULT is stored.")
RECORDING_RELEASE = define("state.recording_release", "NO_RESULT is stored.")
PLACING_ACCEPT = define("state.placing_accept", "The fruit goes where good fruit goes.")
PLACING_REJECT = define("state.placing_reject", "The fruit goes where rejected fruit goes.")
RELEASING = define("state.releasing", "The jaws open and leave the fruit where it is.")
RETREATING = define("state.retreating", "The arm leaves the nest.")
RETREATING_READY = define("state.retreating_ready", "The arm leaves the nest; the next trigger is already accepted.")
RETREATING_ACCEPTING = define("state.retreating_accepting", "A trigger is stored while the arm leaves the nest.")
RETREATING_ACCEPTED = define("state.retreating_accepted", "The next inspection begins once the arm has left the nest.")
RECORDING_HELD = define("state.recording_held", "A device failed; NO_RESULT is stored.")
OPENING_HELD = define("state.opening_held", "A device failed; the jaws open if they can.")
OPENING_UNRECORDED = define("state.opening_unrecorded", "The outcome could not be stored; the jaws open.")
HOMING_UNRECORDED = define("state.homing_unrecorded", "The outcome could not be stored; the arm goes home.")
HELD = define(
    "state.held",
    "Something that an inspection needs is missing: do what its alarm says. The station continues by itself once it is "
    "back.",
)
CARRIED = define(
    "state.carried",
    "A judged fruit may still be between the jaws: take it out, repair what the alarms say, then confirm at the panel.",
)
RECORDING_LATCHED = define(
    "state.recording_latched", "The arm was stopped by its safety system or a person; NO_RESULT is stored."
)
LATCHED = define(
    "state.latched",
    "The arm was stopped by its safety system or a person: make the cell safe, repair the cause, take out what is "
    "between the jaws, then confirm at the panel.",
)
RECOVERING = define("state.recovering", "The arm is recovered after a person's confirmation; wait a moment.")
