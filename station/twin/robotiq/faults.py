"""The gripper's faults: which can be switched on, and the codes that the gripper reports for them.

The common faults mean here, with the board's amount:

| fault | meaning | amount |
|---|---|---|
| off | connections refused and cut; a serial line stays silent | none |
| intermittent | off for every second half of a period | the period, s |
| stuck | commands are acknowledged, nothing moves and no register changes | none |
| garbage | every answer is bytes of no protocol | none |
| wrong | position and echo of the request read too high | counts |
| slow | every motion at its speed divided by (1 + amount) | times, at most 1000 |
| delayed | every answer comes late | s, at most 60 |

Codes: Robotiq 2F-85 manual, fault status register (gFLT).
"""

from enum import IntEnum, StrEnum

from station.twin.faults import FaultBoard


class Code(IntEnum):
    """Values of gFLT."""

    NONE = 0x0
    ACTIVATE_FIRST = 0x5
    ACTIVATION_BIT = 0x7
    OVER_TEMPERATURE = 0x8
    NO_COMMUNICATION = 0x9
    UNDER_VOLTAGE = 0xA
    RELEASING = 0xB
    INTERNAL = 0xC
    ACTIVATION = 0xD
    OVERCURRENT = 0xE
    RELEASED = 0xF


class GripperFault(StrEnum):
    """The gripper's own faults."""

    OBJECT_DROPPED = "object_dropped"
    """What is between the fingers falls out and stays out."""
    OVER_TEMPERATURE = "over_temperature"
    """gFLT 8 and no motion, until it is switched off."""
    NO_COMMUNICATION = "no_communication"
    """gFLT 9 until it is switched off."""
    UNDER_VOLTAGE = "under_voltage"
    """gFLT 0x0A, latched until reset and activation."""
    AUTOMATIC_RELEASE = "automatic_release"
    """The fingers are released slowly: gFLT 0x0B, then 0x0F, latched until reset and activation."""
    INTERNAL_FAULT = "internal_fault"
    """gFLT 0x0C, latched until reset and activation."""
    ACTIVATION_FAULT = "activation_fault"
    """An activation ends in gFLT 0x0D instead of the active state."""
    OVERCURRENT = "overcurrent"
    """gFLT 0x0E, latched until reset and activation."""
    POWER_CUT = "power_cut"
    """Switching it on is the event: without power for a moment, then without activation and at position 0 until it."""
    EMERGENCY_STOPPED = "emergency_stopped"
    """As in an emergency stop, or with a broken cable at the wrist: the URCap answers `?` and the fingers stop for
    good; over Modbus the registers can still be read."""


MAJOR = {
    GripperFault.UNDER_VOLTAGE: Code.UNDER_VOLTAGE,
    GripperFault.AUTOMATIC_RELEASE: Code.RELEASING,
    GripperFault.INTERNAL_FAULT: Code.INTERNAL,
    GripperFault.OVERCURRENT: Code.OVERCURRENT,
}
"""Faults that latch as soon as they are switched on."""

MINOR = {
    GripperFault.OVER_TEMPERATURE: Code.OVER_TEMPERATURE,
    GripperFault.NO_COMMUNICATION: Code.NO_COMMUNICATION,
}
"""Faults that are reported for as long as they are switched on."""


def gripper_faults() -> FaultBoard:
    """A board with the common faults and the gripper's own, all off."""
    return FaultBoard("gripper", tuple(GripperFault))
