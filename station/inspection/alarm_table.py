"""Table of the alarms: number, priority, texts, and what raises each in a test (ISA-18.2)."""

from enum import StrEnum
from typing import NamedTuple

from station.messages import alarms as texts
from station.messages.alarms import AlarmTexts
from station.messages.message import Message


class Priority(StrEnum):
    """Priority of an alarm: how soon an operator has to act; the higher it is, the fewer alarms have it."""

    CRITICAL = "critical"
    HIGH = "high"
    MEDIUM = "medium"
    LOW = "low"


PRIORITIES: dict[Priority, str] = {
    Priority.CRITICAL: "A safety stop is active.",
    Priority.HIGH: "Bad fruit may be among the good, records are lost, or the station cannot come back by itself.",
    Priority.MEDIUM: "Inspections are not made, or good fruit is lost.",
    Priority.LOW: "It can wait for the next pause.",
}
"""Criterion of each."""


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
    CONNECTION_FLOOD = "connection_flood"
    RECORDS_LOST = "records_lost"
    ARM_NOT_READY = "arm_not_ready"
    PLC_JOURNAL_NOT_WRITABLE = "plc_journal_not_writable"


class AlarmRow(NamedTuple):
    """One alarm as its document and the panel show it."""

    number: int
    """The PLC's error code, and from 1 the bit in its alarm registers. Never given to another alarm."""
    priority: Priority
    texts: AlarmTexts
    latched: bool = False
    """Active until a person has reset it, also when its cause is gone."""

    @property
    def cause(self) -> Message:
        """Cause of the alarm: what is wrong."""
        return self.texts.cause()

    @property
    def consequence(self) -> Message:
        """Consequence of the alarm for the fruit or the line."""
        return self.texts.consequence()

    @property
    def action(self) -> Message:
        """Action that an operator has to take."""
        return self.texts.action()


ALARMS: dict[AlarmId, AlarmRow] = {
    AlarmId.EMERGENCY_STOP: AlarmRow(1, Priority.CRITICAL, texts.EMERGENCY_STOP, latched=True),
    AlarmId.PROTECTIVE_STOP: AlarmRow(2, Priority.CRITICAL, texts.PROTECTIVE_STOP, latched=True),
    AlarmId.SAFETY_FAULT: AlarmRow(3, Priority.CRITICAL, texts.SAFETY_FAULT, latched=True),
    AlarmId.FRUIT_HELD: AlarmRow(4, Priority.HIGH, texts.FRUIT_HELD, latched=True),
    AlarmId.ARM_LINK_LOST: AlarmRow(5, Priority.MEDIUM, texts.ARM_LINK_LOST),
    AlarmId.ARM_NOT_REMOTE: AlarmRow(6, Priority.MEDIUM, texts.ARM_NOT_REMOTE),
    AlarmId.GRIPPER_LINK_LOST: AlarmRow(7, Priority.MEDIUM, texts.GRIPPER_LINK_LOST),
    AlarmId.GRIPPER_FAULT: AlarmRow(8, Priority.MEDIUM, texts.GRIPPER_FAULT),
    AlarmId.GRIPPER_JAM: AlarmRow(9, Priority.MEDIUM, texts.GRIPPER_JAM),
    AlarmId.CAMERA_LOST: AlarmRow(10, Priority.MEDIUM, texts.CAMERA_LOST),
    AlarmId.CAMERA_STALE: AlarmRow(11, Priority.MEDIUM, texts.CAMERA_STALE),
    AlarmId.CAMERA_LED_DEAD: AlarmRow(12, Priority.MEDIUM, texts.CAMERA_LED_DEAD),
    AlarmId.CAMERA_DIRTY: AlarmRow(13, Priority.MEDIUM, texts.CAMERA_DIRTY),
    AlarmId.CAMERA_SATURATED: AlarmRow(14, Priority.MEDIUM, texts.CAMERA_SATURATED),
    AlarmId.REFERENCE_BAD: AlarmRow(15, Priority.MEDIUM, texts.REFERENCE_BAD),
    AlarmId.REFERENCE_DRIFTING: AlarmRow(16, Priority.LOW, texts.REFERENCE_DRIFTING),
    AlarmId.PLC_HEARTBEAT_LOST: AlarmRow(17, Priority.MEDIUM, texts.PLC_HEARTBEAT_LOST),
    AlarmId.PLC_INTERFACE_LOST: AlarmRow(18, Priority.MEDIUM, texts.PLC_INTERFACE_LOST),
    AlarmId.CAN_NODE_LOST: AlarmRow(19, Priority.HIGH, texts.CAN_NODE_LOST),
    AlarmId.GATE_NOT_FIRED: AlarmRow(20, Priority.HIGH, texts.GATE_NOT_FIRED),
    AlarmId.RECORDS_NOT_WRITABLE: AlarmRow(21, Priority.HIGH, texts.RECORDS_NOT_WRITABLE),
    AlarmId.DISK_LOW: AlarmRow(22, Priority.LOW, texts.DISK_LOW),
    AlarmId.CONFIGURATION_BROKEN: AlarmRow(23, Priority.LOW, texts.CONFIGURATION_BROKEN),
    AlarmId.RECIPE_BROKEN: AlarmRow(24, Priority.LOW, texts.RECIPE_BROKEN),
    AlarmId.NO_RECIPE: AlarmRow(25, Priority.MEDIUM, texts.NO_RECIPE),
    AlarmId.CLOCK_STEPPED: AlarmRow(26, Priority.LOW, texts.CLOCK_STEPPED),
    AlarmId.PROCESS_RESTARTS: AlarmRow(27, Priority.HIGH, texts.PROCESS_RESTARTS),
    AlarmId.MANY_NO_RESULT: AlarmRow(28, Priority.MEDIUM, texts.MANY_NO_RESULT),
    AlarmId.REJECT_RATE: AlarmRow(29, Priority.LOW, texts.REJECT_RATE),
    AlarmId.DEADLINE_MISSED: AlarmRow(30, Priority.LOW, texts.DEADLINE_MISSED),
    AlarmId.CALIBRATION_OLD: AlarmRow(31, Priority.MEDIUM, texts.CALIBRATION_OLD),
    AlarmId.HMI_LOST: AlarmRow(32, Priority.LOW, texts.HMI_LOST),
    AlarmId.OUTBOX_BEHIND: AlarmRow(33, Priority.LOW, texts.OUTBOX_BEHIND),
    AlarmId.CONNECTION_FLOOD: AlarmRow(34, Priority.LOW, texts.CONNECTION_FLOOD),
    AlarmId.RECORDS_LOST: AlarmRow(35, Priority.HIGH, texts.RECORDS_LOST),
    AlarmId.ARM_NOT_READY: AlarmRow(36, Priority.MEDIUM, texts.ARM_NOT_READY),
    AlarmId.PLC_JOURNAL_NOT_WRITABLE: AlarmRow(37, Priority.LOW, texts.PLC_JOURNAL_NOT_WRITABLE),
}
"""Every alarm, in the order of its number."""

_ORDER = {priority: place for place, priority in enumerate(Priority)}


def urgency(alarm: AlarmId) -> tuple[int, int]:
    """Sort key, most urgent first: priority, number."""
    row = ALARMS[alarm]
    return _ORDER[row.priority], row.number


def heading(alarm: AlarmId) -> str:
    """Anchor of the alarm's heading, as Git hosts make it."""
    return alarm.value.replace("_", "-")


def anchor(alarm: AlarmId) -> str:
    """Address of the alarm's document."""
    return f"docs/alarms.md#{heading(alarm)}"
