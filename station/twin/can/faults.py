"""The faults of the line's CAN nodes.

The common faults mean here, with the board's amount:

| fault | meaning | amount |
|---|---|---|
| off | both nodes are silent and deaf | none |
| intermittent | off for every second half of a period | the period, s |
| stuck | the encoder sends the same count for ever | none |
| garbage | frames too short for what they are, beside the right ones | none |
| wrong | the gate reports actuations under another sequence | none |
| slow | the belt at its speed divided by (1 + amount) | times, at most 1000 |
| delayed | the gate's reports come late | s, at most 60 |
"""

from enum import StrEnum

from station.twin.faults import FaultBoard


class LineFault(StrEnum):
    """The line's own faults."""

    GATE_SILENT = "gate_silent"
    """The gate neither sends nor hears."""
    ENCODER_SILENT = "encoder_silent"
    """The encoder neither sends nor hears."""
    WRONG_IDENTITY = "wrong_identity"
    """The gate reports that it is another product."""
    MAPPING_REFUSED = "mapping_refused"
    """The gate aborts every write to a PDO mapping."""
    MAPPING_CHANGED = "mapping_changed"
    """The gate takes a PDO mapping and holds another."""
    NO_ECHO = "no_echo"
    """The gate fires and reports nothing."""
    MISPLACED = "misplaced"
    """The gate fires so many counts late (amount)."""
    OVERLOAD = "overload"
    """Emergency 0x2310 until it is switched off, then the error reset."""
    BUS_OFF = "bus_off"
    """Once, when it is switched on: the station's driver gets the report that its controller left the bus."""


def line_faults() -> FaultBoard:
    """A board with the common faults and the line's own, all off."""
    return FaultBoard("line", tuple(LineFault))
