"""Every alarm: what it tells the operator, and what makes it come (ISA-18.2: an alarm asks for an action)."""

from enum import StrEnum
from typing import NamedTuple


class Priority(StrEnum):
    """How soon an operator has to act; the fewer the higher."""

    CRITICAL = "critical"
    HIGH = "high"
    MEDIUM = "medium"
    LOW = "low"


PRIORITIES: dict[Priority, str] = {
    Priority.CRITICAL: "A safety stop stands.",
    Priority.HIGH: "Bad fruit may be among the good, or the station cannot come back by itself.",
    Priority.MEDIUM: "Inspections are not made, or good fruit is lost.",
    Priority.LOW: "It can wait for the next pause.",
}
"""What each asks for."""


class AlarmId(StrEnum):
    """The alarms, in the order of their numbers."""

    EMERGENCY_STOP = "emergency_stop"
    PROTECTIVE_STOP = "protective_stop"
    SAFETY_FAULT = "safety_fault"
    FRUIT_HELD = "fruit_held"
    ARM_LINK_LOST = "arm_link_lost"
    ARM_NOT_REMOTE = "arm_not_remote"
    GRIPPER_LINK_LOST = "gripper_link_lost"
    GRIPPER_FAULT = "gripper_fault"
    GRIPPER_JAM = "gripper_jam"
    CAMERA_LOST = "camera_lost"
    CAMERA_STALE = "camera_stale"
    CAMERA_LED_DEAD = "camera_led_dead"
    CAMERA_DIRTY = "camera_dirty"
    CAMERA_SATURATED = "camera_saturated"
    REFERENCE_BAD = "reference_bad"
    REFERENCE_DRIFTING = "reference_drifting"
    PLC_HEARTBEAT_LOST = "plc_heartbeat_lost"
    PLC_INTERFACE_LOST = "plc_interface_lost"
    CAN_NODE_LOST = "can_node_lost"
    GATE_NOT_FIRED = "gate_not_fired"
    RECORDS_NOT_WRITABLE = "records_not_writable"
    DISK_LOW = "disk_low"
    CONFIGURATION_BROKEN = "configuration_broken"
    RECIPE_BROKEN = "recipe_broken"
    NO_RECIPE = "no_recipe"
    CLOCK_STEPPED = "clock_stepped"
    PROCESS_RESTARTS = "process_restarts"
    MANY_NO_RESULT = "many_no_result"
    REJECT_RATE = "reject_rate"
    DEADLINE_MISSED = "deadline_missed"
    CALIBRATION_OLD = "calibration_old"
    HMI_LOST = "hmi_lost"
    OUTBOX_BEHIND = "outbox_behind"


WORD_BITS = 32
"""The alarm word's; what has a higher number concerns no line."""


class Provocation(NamedTuple):
    """What makes an alarm come in a test."""

    device: str
    """`arm`, `gripper` or `camera` of the twin, or what lies in its `nest`; `line`, the simulated PLC, or its `can`
    node; a `process`, the `disk`, the `files` or the `clock`."""
    fault: str


class AlarmRow(NamedTuple):
    """One alarm as its document and the panel show it."""

    number: int
    """The PLC's error code; up to `WORD_BITS` also bit number - 1 of its alarm word. Never given to another alarm."""
    priority: Priority
    cause: str
    consequence: str
    action: str
    provoked_by: tuple[Provocation, ...]
    latched: bool = False
    """Stands until a person has reset it, also when its cause is gone."""


P = Provocation
_STOPPED = "Nothing moves; triggers are refused."
_REFUSED = "Triggers are refused until it is back; the running inspection became NO_RESULT."

ALARMS: dict[AlarmId, AlarmRow] = {
    AlarmId.EMERGENCY_STOP: AlarmRow(
        1,
        Priority.CRITICAL,
        "The emergency stop is pressed.",
        _STOPPED,
        "Make the cell safe, release the button, take out what is between the jaws, then confirm at the panel.",
        (P("arm", "emergency_stop"), P("gripper", "emergency_stopped")),
        latched=True,
    ),
    AlarmId.PROTECTIVE_STOP: AlarmRow(
        2,
        Priority.CRITICAL,
        "The arm stopped itself: it met something, or a joint was overloaded.",
        _STOPPED,
        "Find out why it stopped, clear its way, take out what is between the jaws, then confirm at the panel.",
        (P("arm", "protective_stop"),),
        latched=True,
    ),
    AlarmId.SAFETY_FAULT: AlarmRow(
        3,
        Priority.CRITICAL,
        "The arm's safety system reports a fault.",
        _STOPPED,
        "Read the pendant's log and mend the cause, restart the safety system, then confirm at the panel.",
        (P("arm", "safety_fault"),),
        latched=True,
    ),
    AlarmId.FRUIT_HELD: AlarmRow(
        4,
        Priority.HIGH,
        "Arm or gripper failed before a judged fruit was let go.",
        "The fruit may still be between the jaws; triggers are refused.",
        "Take the fruit out if it is, put it where it belongs, mend the other alarms, then confirm at the panel.",
        (P("arm", "link_cut"), P("gripper", "off")),
        latched=True,
    ),
    AlarmId.ARM_LINK_LOST: AlarmRow(
        5,
        Priority.MEDIUM,
        "The arm's controller does not answer, or its state is old.",
        _REFUSED,
        "Check that the controller is on and its network cable is in; the station connects again by itself.",
        (P("arm", "off"), P("arm", "link_cut"), P("arm", "stuck"), P("arm", "silent")),
    ),
    AlarmId.ARM_NOT_REMOTE: AlarmRow(
        6,
        Priority.MEDIUM,
        "The arm is in local control, its program was stopped, or another client holds its registers.",
        _REFUSED,
        "Switch the pendant to remote control, then `station devices recover program`.",
        (P("arm", "local_mode"), P("arm", "pendant_stop"), P("arm", "registers_in_use")),
    ),
    AlarmId.GRIPPER_LINK_LOST: AlarmRow(
        7,
        Priority.MEDIUM,
        "The gripper does not answer.",
        _REFUSED,
        "Check the gripper's cable and power; the station connects again by itself.",
        (P("gripper", "off"), P("gripper", "garbage")),
    ),
    AlarmId.GRIPPER_FAULT: AlarmRow(
        8,
        Priority.MEDIUM,
        "The gripper reports a fault of its own.",
        _REFUSED,
        "Do what the alarm's detail says; clear the fingers before the gripper is activated again.",
        (P("gripper", "internal_fault"), P("gripper", "over_temperature"), P("gripper", "under_voltage")),
    ),
    AlarmId.GRIPPER_JAM: AlarmRow(
        9,
        Priority.MEDIUM,
        "The gripper answers, but its fingers did not get where they were sent in time.",
        _REFUSED,
        "Look for what blocks the fingers and take it out.",
        (P("gripper", "stuck"), P("gripper", "slow")),
    ),
    AlarmId.CAMERA_LOST: AlarmRow(
        10,
        Priority.MEDIUM,
        "The tactile camera gives no frames, or none of its protocol.",
        _REFUSED,
        "Check the camera's cable; the station connects again by itself.",
        (P("camera", "off"), P("camera", "garbage"), P("camera", "wrong")),
    ),
    AlarmId.CAMERA_STALE: AlarmRow(
        11,
        Priority.MEDIUM,
        "The camera repeats itself, or its frames come late.",
        _REFUSED,
        "Pull the camera's plug and put it in again; if it comes back, change the camera.",
        (P("camera", "stuck"), P("camera", "delayed"), P("camera", "slow")),
    ),
    AlarmId.CAMERA_LED_DEAD: AlarmRow(
        12,
        Priority.MEDIUM,
        "The light of the untouched gel is not the golden reference's: a colour of it is missing.",
        "The inspection became NO_RESULT, and so will the next.",
        "Change the sensor and calibrate it; without a calibration remove the golden reference from the home folder.",
        (P("camera", "led_dead"),),
    ),
    AlarmId.CAMERA_DIRTY: AlarmRow(
        13,
        Priority.MEDIUM,
        "The untouched gel's picture is less sharp than the golden reference's: something fogs or smears it.",
        "The inspection became NO_RESULT, and so will the next.",
        "Clean the lens and the gel with a soft cloth and alcohol.",
        (P("camera", "lens_fogged"),),
    ),
    AlarmId.CAMERA_SATURATED: AlarmRow(
        14,
        Priority.MEDIUM,
        "Frames are torn, shifted, black or at the end of the grey scale.",
        _REFUSED,
        "Shade the sensor from outside light and check its cable and light settings.",
        (P("camera", "frame_saturated"), P("camera", "frame_black"), P("camera", "frame_torn")),
    ),
    AlarmId.REFERENCE_BAD: AlarmRow(
        15,
        Priority.MEDIUM,
        "A reference shows what the golden one does not: something touches the gel, or it is dirty or torn.",
        "The inspection became NO_RESULT, and so will the next.",
        "See that nothing touches the gel; wipe it with a soft cloth and alcohol, and change it if it is torn.",
        (P("camera", "gel_torn"), P("camera", "dirt")),
    ),
    AlarmId.REFERENCE_DRIFTING: AlarmRow(
        16,
        Priority.LOW,
        "The light of the untouched gel moves away from the golden reference's: halfway to where it is refused.",
        "Areas become less certain; further away the reference is refused.",
        "Calibrate at the next pause, on a clean gel; without a calibration remove the home folder's golden reference.",
        (P("camera", "lens_fogged"),),
    ),
    AlarmId.PLC_HEARTBEAT_LOST: AlarmRow(
        17,
        Priority.MEDIUM,
        "The line's PLC is connected, but its heartbeat stands still, or it is not connected.",
        "No triggers come; results wait.",
        "See that the PLC is in run, and that its program writes the heartbeat.",
        (P("line", "heartbeat_frozen"),),
    ),
    AlarmId.PLC_INTERFACE_LOST: AlarmRow(
        18,
        Priority.MEDIUM,
        "The PLC interface's process does not ask any more.",
        "The PLC gets no results; they are kept until it asks again.",
        "Wait for its restart; if it stays away, read its log.",
        (P("process", "plc"),),
    ),
    AlarmId.CAN_NODE_LOST: AlarmRow(
        19,
        Priority.HIGH,
        "The reject gate's or the encoder's CAN node does not answer, or reports an emergency.",
        "The gate rests in its safe position, which rejects.",
        "Check the CAN cable, its terminators and the node's power.",
        (P("can", "off"),),
    ),
    AlarmId.GATE_NOT_FIRED: AlarmRow(
        20,
        Priority.HIGH,
        "The reject gate did not confirm that it fired for a fruit.",
        "A rejected fruit may be among the good ones.",
        "Take the fruit from the line behind the gate; check the gate's air and valve.",
        (P("can", "stuck"),),
    ),
    AlarmId.RECORDS_NOT_WRITABLE: AlarmRow(
        21,
        Priority.HIGH,
        "The records cannot be written: the disk is full or read-only, or the database is damaged.",
        "Triggers are refused: an outcome that is not recorded is not told.",
        "Free space on the disk of the state folder, or make it writable; the station goes on by itself.",
        (P("disk", "full"), P("disk", "read_only")),
    ),
    AlarmId.DISK_LOW: AlarmRow(
        22,
        Priority.LOW,
        "Little space is left on the disk of the state folder.",
        "Images are kept for a shorter time; later the records stop.",
        "Free space, or lower the images' quota.",
        (P("disk", "low"),),
    ),
    AlarmId.CONFIGURATION_BROKEN: AlarmRow(
        23,
        Priority.LOW,
        "The configuration file has an error.",
        "The last good configuration is used.",
        "Mend the line that the detail names; `station devices check` says whether it is good.",
        (P("files", "configuration"),),
    ),
    AlarmId.RECIPE_BROKEN: AlarmRow(
        24,
        Priority.LOW,
        "A recipe's file has an error.",
        "The recipe's last good version is used, or it cannot be chosen.",
        "Mend the line that the detail names; `station recipes check` says whether it is good.",
        (P("files", "recipe"),),
    ),
    AlarmId.NO_RECIPE: AlarmRow(
        25,
        Priority.MEDIUM,
        "No recipe is active.",
        "Triggers are refused.",
        "Choose the fruit's recipe at the panel or by the PLC's command.",
        (P("files", "no_recipe"),),
    ),
    AlarmId.CLOCK_STEPPED: AlarmRow(
        26,
        Priority.LOW,
        "The machine's clock was set by more than a moment.",
        "Records before and after it do not follow each other by their time; durations are right.",
        "Check the machine's time server.",
        (P("clock", "step"),),
    ),
    AlarmId.PROCESS_RESTARTS: AlarmRow(
        27,
        Priority.HIGH,
        "A process of the station ended three times within a minute.",
        "What it does is missing meanwhile; after the sixth time it is not started again.",
        "Read its log for why it ends and mend that; if it was given up, start the station again.",
        (P("process", "crash_loop"),),
    ),
    AlarmId.MANY_NO_RESULT: AlarmRow(
        28,
        Priority.MEDIUM,
        "Five fruit in a row could not be judged.",
        "Good fruit is diverted.",
        "Look at the reasons: clean the gel, check how the fruit lies, and whether the recipe is the fruit's.",
        (P("nest", "empty"), P("camera", "lens_fogged")),
    ),
    AlarmId.REJECT_RATE: AlarmRow(
        29,
        Priority.LOW,
        "More than ten of the last twenty fruit failed.",
        "The lot is bad, or the measurement is.",
        "Look at some rejected fruit; check the lot, the recipe and the gel.",
        (P("nest", "bruised"),),
    ),
    AlarmId.DEADLINE_MISSED: AlarmRow(
        30,
        Priority.LOW,
        "An inspection did not end within its deadline.",
        "Its outcome is NO_RESULT, and the line diverts the fruit.",
        "Look at which phase was slow; check the load of the machine and the arm's speed slider.",
        (P("arm", "slow"), P("gripper", "delayed")),
    ),
    AlarmId.CALIBRATION_OLD: AlarmRow(
        31,
        Priority.LOW,
        "The sensor is not calibrated, its calibration is older than allowed, or its last verification failed.",
        "Areas in mm² may be wrong; without a calibration, and where verification is demanded, triggers are refused.",
        "At the next pause stop the station and run `station verify`; where that fails, or there is no calibration, "
        "`station calibrate`.",
        (P("camera", "gel_worn"),),
    ),
    AlarmId.HMI_LOST: AlarmRow(
        32,
        Priority.LOW,
        "The process of the operators' pages does not ask any more.",
        "Nobody sees the station or acts at the panel; inspections go on.",
        "Wait for its restart; if it stays away, read its log and start the station again.",
        (P("process", "hmi"),),
    ),
    AlarmId.OUTBOX_BEHIND: AlarmRow(
        33,
        Priority.LOW,
        "Another system, PostgreSQL or the MQTT broker, has not been told of inspections for longer than allowed.",
        "It shows the past; nothing is lost, and the line goes on. What waits is told in order once it can be.",
        "See `station outbox status` for why: the other system, the network to it, or the outbox's own process.",
        (P("process", "postgresql_away"),),
    ),
}
"""Every alarm, in the order of its number."""

_ORDER = {priority: place for place, priority in enumerate(Priority)}


def urgency(alarm: AlarmId) -> tuple[int, int]:
    """What to sort by, the most urgent first: priority, then number."""
    row = ALARMS[alarm]
    return _ORDER[row.priority], row.number


def anchor(alarm: AlarmId) -> str:
    """Where its document explains it."""
    return f"docs/alarms.md#{alarm.value.replace('_', '-')}"
