"""What makes each alarm come: a fault of the twin, of the simulated line, or of the machine."""

from typing import NamedTuple

from station.inspection.alarm_table import AlarmId


class Provocation(NamedTuple):
    """What makes an alarm come in a test."""

    device: str
    """`arm`, `gripper` or `camera` of the twin, or what is in its `nest`; `line`, the simulated PLC, or its `can`
    node; a `process`, the `disk`, the `files` or the `clock`."""
    fault: str


PROVOCATIONS: dict[AlarmId, tuple[Provocation, ...]] = {
    AlarmId.EMERGENCY_STOP: (Provocation("arm", "emergency_stop"), Provocation("gripper", "emergency_stopped")),
    AlarmId.PROTECTIVE_STOP: (Provocation("arm", "protective_stop"),),
    AlarmId.SAFETY_FAULT: (Provocation("arm", "safety_fault"),),
    AlarmId.FRUIT_HELD: (Provocation("arm", "link_cut"), Provocation("gripper", "off")),
    AlarmId.ARM_LINK_LOST: (
        Provocation("arm", "off"),
        Provocation("arm", "link_cut"),
        Provocation("arm", "stuck"),
        Provocation("arm", "silent"),
    ),
    AlarmId.ARM_NOT_REMOTE: (
        Provocation("arm", "local_mode"),
        Provocation("arm", "pendant_stop"),
        Provocation("arm", "registers_in_use"),
    ),
    AlarmId.GRIPPER_LINK_LOST: (Provocation("gripper", "off"), Provocation("gripper", "garbage")),
    AlarmId.GRIPPER_FAULT: (
        Provocation("gripper", "internal_fault"),
        Provocation("gripper", "over_temperature"),
        Provocation("gripper", "under_voltage"),
    ),
    AlarmId.GRIPPER_JAM: (Provocation("gripper", "stuck"), Provocation("gripper", "slow")),
    AlarmId.CAMERA_LOST: (
        Provocation("camera", "off"),
        Provocation("camera", "garbage"),
        Provocation("camera", "wrong"),
    ),
    AlarmId.CAMERA_STALE: (
        Provocation("camera", "stuck"),
        Provocation("camera", "delayed"),
        Provocation("camera", "slow"),
    ),
    AlarmId.CAMERA_LED_DEAD: (Provocation("camera", "led_dead"),),
    AlarmId.CAMERA_DIRTY: (Provocation("camera", "lens_fogged"),),
    AlarmId.CAMERA_SATURATED: (
        Provocation("camera", "frame_saturated"),
        Provocation("camera", "frame_black"),
        Provocation("camera", "frame_torn"),
    ),
    AlarmId.REFERENCE_BAD: (Provocation("camera", "gel_torn"), Provocation("camera", "dirt")),
    AlarmId.REFERENCE_DRIFTING: (Provocation("camera", "lens_fogged"),),
    AlarmId.PLC_HEARTBEAT_LOST: (Provocation("line", "frozen_heartbeat"),),
    AlarmId.PLC_INTERFACE_LOST: (Provocation("process", "plc"),),
    AlarmId.CAN_NODE_LOST: (Provocation("can", "off"),),
    AlarmId.GATE_NOT_FIRED: (Provocation("can", "stuck"),),
    AlarmId.RECORDS_NOT_WRITABLE: (Provocation("disk", "full"), Provocation("disk", "read_only")),
    AlarmId.DISK_LOW: (Provocation("disk", "low"),),
    AlarmId.CONFIGURATION_BROKEN: (Provocation("files", "configuration"),),
    AlarmId.RECIPE_BROKEN: (Provocation("files", "recipe"),),
    AlarmId.NO_RECIPE: (Provocation("files", "no_recipe"),),
    AlarmId.CLOCK_STEPPED: (Provocation("clock", "step"),),
    AlarmId.PROCESS_RESTARTS: (Provocation("process", "crash_loop"),),
    AlarmId.MANY_NO_RESULT: (Provocation("nest", "empty"), Provocation("camera", "lens_fogged")),
    AlarmId.REJECT_RATE: (Provocation("nest", "bruised"),),
    AlarmId.DEADLINE_MISSED: (Provocation("arm", "slow"), Provocation("gripper", "delayed")),
    AlarmId.CALIBRATION_OLD: (Provocation("camera", "gel_worn"),),
    AlarmId.HMI_LOST: (Provocation("process", "hmi"),),
    AlarmId.OUTBOX_BEHIND: (Provocation("process", "postgresql_away"),),
    AlarmId.CONNECTION_FLOOD: (Provocation("process", "connections"),),
    AlarmId.RECORDS_LOST: (Provocation("files", "database_damaged"), Provocation("files", "database_removed")),
    AlarmId.ARM_NOT_READY: (Provocation("arm", "safeguard"), Provocation("arm", "wrong")),
    AlarmId.PLC_JOURNAL_NOT_WRITABLE: (Provocation("files", "plc_journal"),),
}
