"""Every alarm: what it tells the operator, and what makes it come (ISA-18.2: an alarm asks for an action)."""

from enum import StrEnum
from typing import NamedTuple


class Priority(StrEnum):
    """How soon an operator has to act; few are critical, most are low."""

    CRITICAL = "critical"
    HIGH = "high"
    MEDIUM = "medium"
    LOW = "low"


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
    HMI_LOST = "hmi_lost"


class Provocation(NamedTuple):
    """What makes an alarm come in a test."""

    device: str
    """`arm`, `gripper` or `camera` of the twin, its `nest`, the simulated `line` or `can` node, a `process`, the
    `disk`, the `files` or the `clock`."""
    fault: str


class AlarmRow(NamedTuple):
    """One alarm as its document and the panel show it."""

    number: int
    """1 to 32; bit number - 1 of the alarm word, and the PLC's error code. Never given to another alarm."""
    priority: Priority
    cause: str
    consequence: str
    action: str
    provocation: Provocation
    latched: bool = False
    """Stands until a person has reset it, also when its cause is gone."""


ALARMS: dict[AlarmId, AlarmRow] = {}
