"""Regions of the handshake, their modes, and the signals that change these."""

from enum import StrEnum


class Link(StrEnum):
    """The link to the station over the channel."""

    LOST = "lost"
    """It does not answer in time."""
    RESUMING = "resuming"
    """It answers; what is open has still to be settled."""
    UP = "up"


class Arming(StrEnum):
    """The enable bit."""

    DISARMED = "disarmed"
    """After a start of the interface: enable has to be given anew, written 0, then 1."""
    WITHDRAWN = "withdrawn"
    """As DISARMED, because the armed PLC's heartbeat or connection was lost."""
    RELEASED = "released"
    """Enable was written 0."""
    ARMED = "armed"


class Service(StrEnum):
    """The offline bit, and the end of this process."""

    IN_SERVICE = "in service"
    OFFLINE = "offline"
    ENDING = "ending"
    """As OFFLINE, independent of what the PLC writes."""


class Trigger(StrEnum):
    """The trigger bit and its acknowledgement."""

    LOW = "low"
    PENDING = "pending"
    """The bit is high, the station has still to accept or refuse."""
    PULSED = "pulsed"
    """As PENDING, but the PLC has reset its bit already."""
    ANSWERED = "answered"
    """Acknowledged; the PLC's bit has to fall."""
    HELD = "held"
    """Acknowledged after the bit had fallen; published for the handshake's time-out."""
    STUCK = "stuck"
    """The PLC forgot its bit; it has to fall before it can rise."""


class Inspection(StrEnum):
    """The one inspection that can be in progress."""

    NONE = "none"
    BEGINNING = "beginning"
    RUNNING = "running"


class Result(StrEnum):
    """The result block and its acknowledgement."""

    WITHHELD = "withheld"
    """After a start: what the PLC has taken is in its first write, and may be missing in the journal."""
    EMPTY = "empty"
    PUBLISHED = "published"
    TAKEN = "taken"
    """Acknowledged; the PLC's bit has to fall before the next result is published."""


class Command(StrEnum):
    """The PLC's commands."""

    IDLE = "idle"
    EXECUTING = "executing"
    DONE = "done"
    FAILED = "failed"


class Lot(StrEnum):
    """The lot latch."""

    OPEN = "open"
    LATCHED = "latched"


Mode = Link | Arming | Service | Trigger | Inspection | Result | Command | Lot


class Signal(StrEnum):
    """Inputs of the table."""

    # the PLC's bits and registers
    ENABLE_ON = "enable on"
    ENABLE_OFF = "enable off"
    OFFLINE_ON = "offline on"
    OFFLINE_OFF = "offline off"
    TRIGGER_ON = "trigger on"
    TRIGGER_OFF = "trigger off"
    TRIGGER_HELD = "trigger still on after a reconnect"
    ACKNOWLEDGED = "sequence acknowledged"
    WRONG_ACKNOWLEDGEMENT = "another sequence acknowledged"
    FIRST_WRITE = "first write after a start"
    ACKNOWLEDGE_AFTER = "acknowledge on for the sequence just taken"
    ACKNOWLEDGE_OFF = "acknowledge off"
    EXECUTE_ON = "execute on"
    EXECUTE_OFF = "execute off"
    LATCH_ON = "latch lot on"
    LATCH_OFF = "latch lot off"
    CLEAR_ON = "clear error on"
    RESET_ON = "reset counters on"
    WRITER_LOST = "writer lost"
    # times that ran out
    PLC_SILENT = "PLC heartbeat lost"
    TRIGGER_TIMEOUT = "trigger time-out"
    ACKNOWLEDGE_TIMEOUT = "acknowledge time-out"
    EXECUTE_TIMEOUT = "execute time-out"
    LATCH_TIMEOUT = "latch time-out"
    RESULT_DEADLINE = "result deadline"
    STATION_SILENT = "station silent"
    # the station's answers
    STATION_ANSWERED = "beat answered"
    STATION_RESTARTED = "beat answered by a new start"
    CHANNEL_FAILED = "request failed"
    OPENED = "resume answered"
    BEGUN = "begun"
    BEGIN_REFUSED = "begin refused"
    BEGIN_FAILED = "begin failed"
    STATION_BUSY = "station busy, with what is not known here"
    OUTCOME = "outcome"
    FOREIGN_OUTCOME = "outcome of another sequence"
    COMMAND_DONE = "command done"
    COMMAND_REFUSED = "command refused"
    COMMAND_FAILED = "command failed"
    # from this process
    SHUTTING_DOWN = "interface ends"
    # from one region to another
    BEGIN = "begin"
    ACCEPTED = "accepted"
    REFUSED = "refused"
    QUEUED = "result queued"
    RESUMED_RUN = "inspection resumed"
    GONE = "inspection unknown to the station"


TIMERS = (
    Signal.STATION_SILENT,
    Signal.PLC_SILENT,
    Signal.RESULT_DEADLINE,
    Signal.TRIGGER_TIMEOUT,
    Signal.ACKNOWLEDGE_TIMEOUT,
    Signal.EXECUTE_TIMEOUT,
    Signal.LATCH_TIMEOUT,
)
"""The signals that time gives; of several that are due at once, the earlier one here comes first."""
