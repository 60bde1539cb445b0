"""Messages of the running station: what its checks found, and what ended an inspection."""

from station.messages.message import Message, Nested, Number, define

INTERFACE_SILENT = define(
    "operation.interface_silent", "the PLC interface has sent nothing for {age_s} s", age_s=Number(0)
)
HEARTBEAT_STILL = define("operation.heartbeat_still", "the PLC's heartbeat does not change")
PLC_GONE = define("operation.plc_gone", "the PLC has lost its connection, or it does not write any more")
PAGES_SILENT = define("operation.pages_silent", "the pages' process has sent no request for {age_s} s", age_s=Number(0))
PAGES_FLOODED = define("operation.pages_flooded", "connections of {address} to the pages are turned away")
METRICS_FLOODED = define("operation.metrics_flooded", "connections of {address} to the metrics are turned away")
DISK_LOW = define(
    "operation.disk_low",
    "{free_mb} MB are free, {reserve_mb} MB are the reserve",
    free_mb=Number(0),
    reserve_mb=Number(0),
)
NEVER_CHOSEN = define("operation.never_chosen", "no recipe was ever chosen, or it is gone")
PROCESS_GIVEN_UP = define(
    "operation.process_given_up", "the process {process} ended again and again and is not started any more"
)
PROCESS_RESTARTED = define(
    "operation.process_restarted",
    "the process {process} was started again {times} times within {within_s} s",
    times=Number(),
)
CLOCK_FORWARD = define("operation.clock_forward", "the machine's clock was set forward by {step_s} s", step_s=Number(0))
CLOCK_BACK = define("operation.clock_back", "the machine's clock was set back by {step_s} s", step_s=Number(0))
MANY_UNJUDGED = define("operation.many_unjudged", "the last {number} fruit could not be judged")
MANY_FAILED = define("operation.many_failed", "{failed} of the last {number} fruit failed", failed=Number())
LIGHT_DRIFTS = define(
    "operation.light_drifts",
    "the light differs from the golden reference's by {drift_levels} grey levels; {limit_levels} are too many",
    drift_levels=Number(0),
)
REFERENCE_OLD = define(
    "operation.reference_old",
    "the reference was {age_s} s old at the last step, at most {limit_s} s are allowed",
    age_s=Number(0),
)
JAWS_NOT_OPEN = define(
    "operation.jaws_not_open",
    "the jaws are at {width_mm} mm and not open: something may touch the gel; look at them",
    width_mm=Number(1),
)
INSPECTION_LATE = define(
    "operation.inspection_late",
    "the inspection took {took_s} s, at most {limit_s} s are allowed",
    took_s=Number(1),
    limit_s=Number(1),
)
PHASE_LATE = define(
    "operation.phase_late",
    "this took {took_s} s, at most {limit_s} s are allowed: {activity}",
    took_s=Number(1),
    limit_s=Number(1),
    activity=Nested(),
)
NOT_STORED_IN_TIME = define("operation.not_stored_in_time", "the outcome could not be stored in time")
ANOTHER_OUTCOME = define("operation.another_outcome", "the PLC got another outcome for this fruit meanwhile")
TRIGGER_GIVEN_UP = define(
    "operation.trigger_given_up", "the trigger was accepted too late: the PLC has read that it is refused"
)
STATION_ENDS = define("operation.station_ends", "the station was ended")
STOPPED_AT_PANEL = define("operation.stopped_at_panel", "a person stopped the station at the panel")
CALLED_OFF = define("operation.called_off", "the PLC or a person called the inspection off")
RESET = define("operation.reset", "a person has reset the station")
INTERNAL_FAULT = define("operation.internal_fault", "a fault of the software, see the log: {words}")
DEADLINE_TOO_SHORT = define(
    "operation.deadline_too_short",
    "recipe {recipe}: an inspection may take {needed_s} s here, but service.inspection_deadline_s is {allowed_s} s; "
    "raise it, and the PLC's time-out with it, or use fewer steps, a shorter settle time or fewer frames",
    needed_s=Number(1),
    allowed_s=Number(1),
)
INSPECTION_TOO_LONG = define(
    "operation.inspection_too_long",
    "recipe {recipe}: an inspection may take {needed_s} s here, expected at most {limit_s} s; use fewer steps, a "
    "shorter settle time or fewer frames",
    needed_s=Number(0),
)


def internal_fault(error: Exception) -> Message:
    """Return the message of an error that no code expected: its type and text."""
    return INTERNAL_FAULT(words=f"{type(error).__name__}: {error}")
