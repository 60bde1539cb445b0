"""Messages of the alarms: for each its cause, its consequence for the fruit or the line, and the operator's action."""

from typing import NamedTuple

from station.messages.message import Definition, define


class AlarmTexts(NamedTuple):
    """Texts of an alarm for the operator."""

    cause: Definition
    consequence: Definition
    action: Definition


_STOPPED = define("alarm.consequence.stopped", "Nothing moves; triggers are refused.")
_REFUSED = define(
    "alarm.consequence.refused", "Triggers are refused until it is back; the running inspection became NO_RESULT."
)
_NO_RESULT = define("alarm.consequence.no_result", "The inspection became NO_RESULT, and so will the next.")


EMERGENCY_STOP = AlarmTexts(
    define("alarm.cause.emergency_stop", "The emergency stop is pressed."),
    _STOPPED,
    define(
        "alarm.action.emergency_stop",
        "Make the cell safe, release the button, take out what is between the jaws, then confirm at the panel.",
    ),
)
PROTECTIVE_STOP = AlarmTexts(
    define("alarm.cause.protective_stop", "The arm stopped itself: it met something, or a joint was overloaded."),
    _STOPPED,
    define(
        "alarm.action.protective_stop",
        "Find out why it stopped, clear its way, take out what is between the jaws, then confirm at the panel.",
    ),
)
SAFETY_FAULT = AlarmTexts(
    define("alarm.cause.safety_fault", "The arm's safety system reports a fault."),
    _STOPPED,
    define(
        "alarm.action.safety_fault",
        "Read the pendant's log and repair the cause, restart the safety system, then confirm at the panel.",
    ),
)
FRUIT_HELD = AlarmTexts(
    define("alarm.cause.fruit_held", "Arm or gripper failed before a judged fruit was let go."),
    define("alarm.consequence.fruit_held", "The fruit may still be between the jaws; triggers are refused."),
    define(
        "alarm.action.fruit_held",
        "Take the fruit out if it is there, put it where it belongs, repair the cause of the other alarms, then "
        "confirm at the panel.",
    ),
)
ARM_LINK_LOST = AlarmTexts(
    define("alarm.cause.arm_link_lost", "The arm's controller does not answer, or its state is old."),
    _REFUSED,
    define(
        "alarm.action.arm_link_lost",
        "Check that the controller is on and its network cable is in; the station connects again by itself.",
    ),
)
ARM_NOT_REMOTE = AlarmTexts(
    define(
        "alarm.cause.arm_not_remote",
        "The arm is in local control, its program was stopped, or another client holds its registers.",
    ),
    _REFUSED,
    define(
        "alarm.action.arm_not_remote",
        "Switch the pendant to remote control, then start the arm's program on the page Run, or by"
        " `station devices recover program`. After a stop on the pendant also confirm at the panel.",
    ),
)
ARM_NOT_READY = AlarmTexts(
    define(
        "alarm.cause.arm_not_ready",
        "The arm answers, but cannot move: a guard is open, it has no power, its program was stopped, or it did not "
        "reach a pose.",
    ),
    _REFUSED,
    define(
        "alarm.action.arm_not_ready",
        "Do what the alarm's detail says: guard closed? Arm switched on? Its way free? Then confirm at the panel if it "
        "does not continue by itself.",
    ),
)
GRIPPER_LINK_LOST = AlarmTexts(
    define("alarm.cause.gripper_link_lost", "The gripper does not answer."),
    _REFUSED,
    define(
        "alarm.action.gripper_link_lost", "Check the gripper's cable and power; the station connects again by itself."
    ),
)
GRIPPER_FAULT = AlarmTexts(
    define("alarm.cause.gripper_fault", "The gripper reports a fault of its own."),
    _REFUSED,
    define(
        "alarm.action.gripper_fault",
        "Do what the alarm's detail says; clear the fingers before the gripper is activated again.",
    ),
)
GRIPPER_JAM = AlarmTexts(
    define("alarm.cause.gripper_jam", "The gripper answers, but its fingers did not get where they were sent in time."),
    _REFUSED,
    define("alarm.action.gripper_jam", "Look for what blocks the fingers and take it out."),
)
CAMERA_LOST = AlarmTexts(
    define("alarm.cause.camera_lost", "The tactile camera sends no frames, or frames of another protocol or size."),
    _REFUSED,
    define("alarm.action.camera_lost", "Check the camera's cable; the station connects again by itself."),
)
CAMERA_STALE = AlarmTexts(
    define("alarm.cause.camera_stale", "The camera repeats the same frame, or its frames come late."),
    _REFUSED,
    define(
        "alarm.action.camera_stale",
        "Unplug the camera and plug it in again; if the alarm comes back, replace the camera.",
    ),
)
CAMERA_LED_DEAD = AlarmTexts(
    define(
        "alarm.cause.camera_led_dead",
        "The illumination of the untouched gel differs from the golden reference's: one colour is missing.",
    ),
    _NO_RESULT,
    define(
        "alarm.action.camera_led_dead",
        "Change the sensor and calibrate it; without a calibration remove the golden reference from the home folder.",
    ),
)
CAMERA_DIRTY = AlarmTexts(
    define(
        "alarm.cause.camera_dirty",
        "The untouched gel's picture is less sharp than the golden reference's: something fogs or smears it.",
    ),
    _NO_RESULT,
    define("alarm.action.camera_dirty", "Clean the lens and the gel with a soft cloth and alcohol."),
)
CAMERA_SATURATED = AlarmTexts(
    define("alarm.cause.camera_saturated", "Frames are torn, shifted, black or at the end of the grey scale."),
    _REFUSED,
    define(
        "alarm.action.camera_saturated", "Shade the sensor from outside light and check its cable and light settings."
    ),
)
REFERENCE_BAD = AlarmTexts(
    define(
        "alarm.cause.reference_bad",
        "A reference shows what the golden one does not: something touches the gel, or it is dirty or torn.",
    ),
    _NO_RESULT,
    define(
        "alarm.action.reference_bad",
        "Make sure that nothing touches the gel; wipe it with a soft cloth and alcohol, and change it if it is torn.",
    ),
)
REFERENCE_DRIFTING = AlarmTexts(
    define(
        "alarm.cause.reference_drifting",
        "The illumination of the untouched gel has drifted from the golden reference by more than half of what is "
        "allowed.",
    ),
    define("alarm.consequence.reference_drifting", "Areas become less certain; further away the reference is refused."),
    define(
        "alarm.action.reference_drifting",
        "Calibrate at the next pause, on a clean gel; without a calibration remove the home folder's golden reference.",
    ),
)
PLC_HEARTBEAT_LOST = AlarmTexts(
    define(
        "alarm.cause.plc_heartbeat_lost",
        "The line's PLC had set `enable`, then its heartbeat stopped or its connection was lost. A PLC that has not "
        "set `enable` since the PLC interface's start raises no alarm.",
    ),
    define("alarm.consequence.plc_heartbeat_lost", "No triggers come; results wait."),
    define(
        "alarm.action.plc_heartbeat_lost",
        "Make sure that the PLC is in run, and that its program writes the heartbeat.",
    ),
)
PLC_INTERFACE_LOST = AlarmTexts(
    define("alarm.cause.plc_interface_lost", "The PLC interface's process does not send messages any more."),
    define("alarm.consequence.plc_interface_lost", "The PLC gets no results; they are kept until the process is back."),
    define("alarm.action.plc_interface_lost", "Wait for its restart; if it stays away, read its log."),
)
CAN_NODE_LOST = AlarmTexts(
    define(
        "alarm.cause.can_node_lost",
        "The reject gate's or the encoder's CAN node does not answer, or reports an emergency.",
    ),
    define("alarm.consequence.can_node_lost", "The gate rests in its safe position, which rejects."),
    define("alarm.action.can_node_lost", "Check the CAN cable, its terminators and the node's power."),
)
GATE_NOT_FIRED = AlarmTexts(
    define("alarm.cause.gate_not_fired", "The reject gate did not confirm that it fired for a fruit."),
    define("alarm.consequence.gate_not_fired", "A rejected fruit may be among the good ones."),
    define(
        "alarm.action.gate_not_fired",
        "Take the fruit from the line behind the gate; check the gate's air and valve. Acknowledging ends this alarm; "
        "each further failure raises it again.",
    ),
)
RECORDS_NOT_WRITABLE = AlarmTexts(
    define(
        "alarm.cause.records_not_writable",
        "The records cannot be written: the disk is full or read-only, or the database is damaged.",
    ),
    define(
        "alarm.consequence.records_not_writable",
        "Triggers are refused: an outcome that is not recorded is not published.",
    ),
    define(
        "alarm.action.records_not_writable",
        "Free space on the disk of the state folder, or make it writable; the station goes on by itself.",
    ),
)
DISK_LOW = AlarmTexts(
    define("alarm.cause.disk_low", "Little space is left on the disk of the state folder."),
    define("alarm.consequence.disk_low", "Images are kept for a shorter time; later the records stop."),
    define("alarm.action.disk_low", "Free space, or lower the images' quota."),
)
CONFIGURATION_BROKEN = AlarmTexts(
    define("alarm.cause.configuration_broken", "The configuration file has an error."),
    define("alarm.consequence.configuration_broken", "The last good configuration is used."),
    define(
        "alarm.action.configuration_broken",
        "Correct the line that the detail names; `station config check` reports whether it is good. Then start the "
        "station again.",
    ),
)
RECIPE_BROKEN = AlarmTexts(
    define("alarm.cause.recipe_broken", "A recipe's file has an error or is not approved."),
    define("alarm.consequence.recipe_broken", "The recipe's last good version is used, or it cannot be chosen."),
    define(
        "alarm.action.recipe_broken",
        "Correct the line that the detail names, or have the draft approved; `station recipes check` reports the rest.",
    ),
)
NO_RECIPE = AlarmTexts(
    define("alarm.cause.no_recipe", "No recipe is active."),
    define("alarm.consequence.no_recipe", "Triggers are refused."),
    define("alarm.action.no_recipe", "Choose the fruit's recipe at the panel or by the PLC's command."),
)
CLOCK_STEPPED = AlarmTexts(
    define("alarm.cause.clock_stepped", "The machine's clock was set by more than 2 s."),
    define(
        "alarm.consequence.clock_stepped",
        "Records before and after it do not follow each other by their time; durations are right.",
    ),
    define("alarm.action.clock_stepped", "Check the machine's time server."),
)
PROCESS_RESTARTS = AlarmTexts(
    define("alarm.cause.process_restarts", "A process of the station ended three times within a minute."),
    define(
        "alarm.consequence.process_restarts",
        "What it does is missing meanwhile; after the sixth time it is not started again.",
    ),
    define(
        "alarm.action.process_restarts",
        "Read in its log why it ends and repair that; if it was given up, start the station again.",
    ),
)
MANY_NO_RESULT = AlarmTexts(
    define("alarm.cause.many_no_result", "Five fruit in a row could not be judged."),
    define("alarm.consequence.many_no_result", "Good fruit is diverted."),
    define(
        "alarm.action.many_no_result",
        "Look at the reasons: clean the gel, check how the fruit lies, and whether the recipe is the fruit's.",
    ),
)
REJECT_RATE = AlarmTexts(
    define("alarm.cause.reject_rate", "More than ten of the last twenty fruit failed."),
    define("alarm.consequence.reject_rate", "The lot is bad, or the measurement is."),
    define("alarm.action.reject_rate", "Look at some rejected fruit; check the lot, the recipe and the gel."),
)
DEADLINE_MISSED = AlarmTexts(
    define("alarm.cause.deadline_missed", "An inspection did not end within its deadline."),
    define("alarm.consequence.deadline_missed", "Its outcome is NO_RESULT, and the line diverts the fruit."),
    define(
        "alarm.action.deadline_missed",
        "Look at which phase was slow; check the load of the machine and the arm's speed slider.",
    ),
)
CALIBRATION_OLD = AlarmTexts(
    define(
        "alarm.cause.calibration_old",
        "The sensor is not calibrated, its calibration is older than allowed, its last verification failed, or a "
        "required verification is due.",
    ),
    define(
        "alarm.consequence.calibration_old",
        "Areas in mm² may be wrong; without a calibration, and where verification is demanded, triggers are refused.",
    ),
    define(
        "alarm.action.calibration_old",
        "At the next pause verify with the ball: on the page Maintenance, Sensor, or with the station stopped by "
        "`station verify`. Where that fails, or there is no calibration, calibrate.",
    ),
)
HMI_LOST = AlarmTexts(
    define("alarm.cause.hmi_lost", "The process of the operators' pages does not send requests any more."),
    define("alarm.consequence.hmi_lost", "Nobody sees the station or controls it at the panel; inspections continue."),
    define(
        "alarm.action.hmi_lost", "Wait for its restart; if it stays away, read its log and start the station again."
    ),
)
OUTBOX_BEHIND = AlarmTexts(
    define(
        "alarm.cause.outbox_behind",
        "Another system, PostgreSQL or the MQTT broker, has got no inspections for longer than allowed.",
    ),
    define(
        "alarm.consequence.outbox_behind",
        "It shows old data; nothing is lost, and the line continues. What waits is sent in order once it can be.",
    ),
    define(
        "alarm.action.outbox_behind",
        "Read the reason with `station outbox status`: the other system, the network to it, or the outbox's own "
        "process.",
    ),
)
CONNECTION_FLOOD = AlarmTexts(
    define(
        "alarm.cause.connection_flood",
        "Another machine opens more connections than allowed to the pages or the metrics, again and again.",
    ),
    define(
        "alarm.consequence.connection_flood",
        "Its own connections are closed; pages open slowly for others who are not logged in. Inspections continue.",
    ),
    define(
        "alarm.action.connection_flood",
        "Find the machine by the address in the detail, end its program, or pull its network cable.",
    ),
)
RECORDS_LOST = AlarmTexts(
    define(
        "alarm.cause.records_lost",
        "When the records were opened, their database was damaged or missing; a new, empty one was begun.",
    ),
    define(
        "alarm.consequence.records_lost",
        "Earlier inspections, lots, recipes' revisions and the audit trail are not in the records. Inspections "
        "continue, and their numbers go on.",
    ),
    define(
        "alarm.action.records_lost",
        "Keep the folder that the detail names. Restore the last backup soon, with the station stopped "
        "(`station records restore`): what was inspected since the loss is then moved aside. Acknowledging ends this "
        "alarm.",
    ),
)
PLC_JOURNAL_NOT_WRITABLE = AlarmTexts(
    define(
        "alarm.cause.plc_journal_not_writable",
        "The PLC interface's journal cannot be written: the disk is full or read-only, or its folder is another "
        "user's.",
    ),
    define(
        "alarm.consequence.plc_journal_not_writable",
        "Inspections continue; but if the PLC interface or the machine is started again meanwhile, results that the "
        "PLC has not acknowledged may be lost.",
    ),
    define(
        "alarm.action.plc_journal_not_writable",
        "Free space on the disk of the state folder, or make the folder that the detail names writable; do not start "
        "the PLC interface again before.",
    ),
)
