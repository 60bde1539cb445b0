"""Flags and codes of the register map."""

from collections.abc import Mapping

from plc_interface.registers.register import Bit, Code
from station.channel.line import PACKML_STATE_NUMBERS, CommandName, Reason, Refusal


def _bits(*named: tuple[str, str]) -> tuple[Bit, ...]:
    return tuple(Bit(number, name, meaning) for number, (name, meaning) in enumerate(named))


CONTROL_BITS = _bits(
    (
        "enable",
        (
            "Rising edge: arm, so that triggers are accepted. Off: disarmed; a running inspection continues, "
            "its result stays"
        ),
    ),
    ("trigger", "Rising edge: inspect one fruit, by the trigger id written with or before it; hold until answered"),
    ("acknowledge", "Rising edge: the result with the acknowledged sequence is taken; hold until result_valid falls"),
    ("buffer_results", "On: up to 8 results wait for their acknowledgement. Off: one; a trigger before it is refused"),
    ("execute_command", "Rising edge: execute the command code with its argument; hold until done or failed"),
    ("clear_error", "Rising edge: overrun, missed, the last refusal and the reject gate's failures are cleared"),
    ("offline", "The PLC takes the station out of the line: every trigger is refused"),
    ("latch_lot", "Rising edge: the lot id is taken for the inspections from here on; hold until latched"),
    ("reset_counters", "Rising edge: the counters start at 0 and the epoch is raised"),
)

STATUS_BITS = _bits(
    ("online", "The station answers this interface and is not taken offline"),
    ("trigger_ready", "A trigger would be accepted now"),
    ("trigger_acknowledged", "The trigger was answered, by accepted_trigger_id or by last_refusal; falls with it"),
    ("acquiring", "The fruit must stay where it is"),
    ("inspecting", "An inspection is under way"),
    ("result_valid", "The result block holds a result that is not acknowledged"),
    ("overrun", "A trigger was refused because results wait; latched until clear_error"),
    ("missed", "A trigger was refused; latched until clear_error or until a trigger is accepted"),
    ("command_executing", "A command is being carried out"),
    ("command_done", "The command with the echoed sequence is done; falls with execute_command"),
    ("command_failed", "The command with the echoed sequence failed, see its result; falls with execute_command"),
    ("error", "The station is faulted, see the error code and alarms, or it is lost"),
    ("toggle", "Changes with each newly published result; for a display, never for a decision"),
    ("lot_latched", "The lot id was taken; falls with latch_lot"),
    ("writer_owned", "A client has the write lock"),
    ("simulated", "A device of the station is simulated"),
)

MORE_STATUS_BITS = _bits(
    (
        "enable_inhibited",
        "Enable has to be written 0 before it can arm: after a start, or a loss of the writer or its heartbeat",
    ),
)

FLAG_BITS = _bits(
    ("pass", "The outcome is PASS"),
    ("area_valid", "Area and closing are measured values"),
    ("late", "Ended after the deadline; never together with pass"),
    ("partial", "Ended before the recipe's last step"),
    ("simulated", "A simulated device took part"),
)

_REASONS: Mapping[Reason, str] = {
    Reason.AREA_OVER_LIMIT: "The deformed area is over the recipe's limit",
    Reason.GROWTH_OVER_LIMIT: "The area grows faster over closing than the recipe allows",
    Reason.EARLY_STOP: "Stopped before the last step, to spare the fruit",
    Reason.NO_CONTACT: "Nothing was touched",
    Reason.CONTACT_LOST: "The contact was lost while closing",
    Reason.AREA_NOT_RISING: "The area did not rise with closing",
    Reason.CUT_BY_BORDER: "The contact reached the image's border",
    Reason.SATURATED: "The image was too bright or too dark",
    Reason.LOW_CONFIDENCE: "The measurement is not sure enough",
    Reason.REFERENCE_BAD: "The untouched gel could not be recorded",
    Reason.IMAGE_STALE: "The camera gave no new image",
    Reason.OUT_OF_RANGE: "The fruit's width is not one of the recipe's",
    Reason.LATE: "Not ended by the deadline",
    Reason.CALLED_OFF: "Called off by the PLC or by a person",
    Reason.ARM_FAULT: "The arm failed or is stopped",
    Reason.GRIPPER_FAULT: "The gripper failed",
    Reason.CAMERA_FAULT: "The camera failed",
    Reason.RECORDS_FAULT: "The result could not be stored",
    Reason.STATION_LOST: "The station stopped answering or was restarted",
    Reason.INTERNAL_FAULT: "A fault of the software, see the log",
    Reason.NEAR_LIMIT: "The area or its growth is too near to a limit to decide",
    Reason.SIZE_UNKNOWN: "The fruit's size is missing, impossible or contradicts itself",
}
REASON_BITS = _bits(*((reason.value, _REASONS[reason]) for reason in Reason))
"""In the order of `Reason`, bit 0 first."""

ALARM_BITS, MORE_ALARM_BITS = (
    _bits(*((f"alarm_{number}", f"Alarm {number} is active") for number in range(first, first + 32)))
    for first in (1, 33)
)

_REFUSALS: Mapping[Refusal, str] = {
    Refusal.NOT_ENABLED: "Enable is off",
    Refusal.NOT_READY: "The station is not ready, see the error code and PackML state",
    Refusal.BUSY: "An inspection is under way, or its fruit is not released yet",
    Refusal.QUEUE_FULL: "Results wait for their acknowledgement",
    Refusal.BAD_TRIGGER_ID: "The trigger id is 0 or the one of the trigger before",
    Refusal.OFFLINE: "The PLC has set offline, or the interface is about to end",
    Refusal.STATION_LOST: "The station does not answer",
    Refusal.RECIPE_CHANGING: "A recipe is being changed",
    Refusal.NOT_WRITER: "Reserved: a client without the write lock gets exception 06",
    Refusal.RECORDS_FULL: "The station could not store the trigger",
}
REFUSAL_CODES = {
    0: Code("none", "No trigger was refused since the last clear"),
    **{number: Code(refusal.value, _REFUSALS[refusal]) for number, refusal in enumerate(Refusal, start=1)},
}
"""In the order of `Refusal`, from 1."""

_COMMANDS: Mapping[CommandName, str] = {
    CommandName.CHANGE_RECIPE: "Argument: the recipe's number; takes effect between fruits",
    CommandName.RESET: "A person has made sure that nothing is between the jaws: leave a stop whose cause is gone, "
    "none that a person ordered at the panel, no protective or emergency stop. Never sent by a program by itself",
    CommandName.CALL_OFF: "End the running inspection with NO_RESULT",
    CommandName.SET_MODE: "Argument: PackML mode, 1 production, 2 maintenance, 3 manual",
    CommandName.CLEAR_ALARMS: "Acknowledge every alarm whose cause is gone",
}
COMMAND_CODES = {
    0: Code("none", "No command"),
    **{number: Code(command.value, _COMMANDS[command]) for number, command in enumerate(CommandName, start=1)},
}
"""In the order of `CommandName`, from 1."""

COMMAND_RESULT_CODES = {
    0: Code("none", "No command yet; a start of the interface keeps the last one's result"),
    1: Code("executing", "Being carried out"),
    2: Code("done", "Done"),
    3: Code("failed", "Not executed: the log and the HMI give the reason; or another command had this sequence"),
    4: Code("timed_out", "The station did not end it in time, or the interface was restarted meanwhile"),
    5: Code("station_lost", "The station does not answer"),
    6: Code("no_command", "There is no command of this code"),
}

OUTCOME_CODES = {
    0: Code("none", "No result is published"),
    1: Code("PASS", "Surely good"),
    2: Code("FAIL", "Over a limit of the recipe: divert"),
    3: Code("NO_RESULT", "Nothing is known of this fruit: divert"),
}

PACKML_STATE_CODES = {
    0: Code("unknown", "Not known, as after a start"),
    **{
        number: Code(state.value, f"PackML {state.value.capitalize()}")
        for state, number in PACKML_STATE_NUMBERS.items()
    },
}
"""ISA-TR88.00.02-2022, table 1."""

PACKML_MODE_CODES = {
    0: Code("unknown", "Not known, as after a start"),
    1: Code("production", "Production"),
    2: Code("maintenance", "Maintenance"),
    3: Code("manual", "Manual"),
}
"""ISA-TR88.00.02-2022, unit modes."""

WRITE_KEY = 0x5AFE
WRITE_KEY_CODES = {
    0: Code("locked", "Writing is not claimed, or is released"),
    WRITE_KEY: Code("claim", "Writing is claimed: an interlock against stray writes, no secret"),
}
