"""Events that reach the handshake from outside. Every event carries its time."""

from dataclasses import dataclass
from typing import NamedTuple

from station.channel.line import BeginReply, Open, Outcome, StationState


class Moment(NamedTuple):
    """A point in time on both clocks."""

    s: float
    """The monotonic clock, s; every wait is measured by it."""
    utc_ms: int
    """Milliseconds since 1970-01-01 UTC; for records only."""


@dataclass(frozen=True, slots=True)
class Inputs:
    """The PLC's decoded values: the control block of the register map."""

    control: frozenset[str] = frozenset()
    """The names of the control bits that are set."""
    trigger_id: int = 0
    acknowledged_sequence: int = 0
    command_code: int = 0
    command_argument: int = 0
    command_sequence: int = 0
    plc_heartbeat: int = 0
    encoder: int = 0
    lot: str | None = ""
    """None where the registers do not hold printable ASCII, or were not written since this start."""
    fruit_length_mm_x10: int = 0
    size_class: int = 0


@dataclass(frozen=True, slots=True)
class Event:
    """Base of all events."""

    at: Moment


@dataclass(frozen=True, slots=True)
class PlcWrote(Event):
    """The writer wrote into the control block; the named registers hold new values, or the same again."""

    inputs: Inputs
    written: frozenset[str]


class WriterGranted(Event):
    """A client got the right to write."""


class WriterWithdrawn(Event):
    """The client with the right to write closed, died, or released it."""


class Tick(Event):
    """Only time has passed."""


@dataclass(frozen=True, slots=True)
class Beat(Event):
    """The station answered a beat."""

    station: StationState
    asked_s: float
    """When the beat was sent, on the monotonic clock: the state may be as old."""


@dataclass(frozen=True, slots=True)
class OutputChanged(Event):
    """The line's output can, or cannot, divert a fruit now."""

    ready: bool


@dataclass(frozen=True, slots=True)
class BeginAnswered(Event):
    """The station's answer to `RequestBegin` with this number."""

    number: int
    begun: BeginReply


@dataclass(frozen=True, slots=True)
class BeginFailed(Event):
    """`RequestBegin` got no answer; whether it was carried out is unknown."""

    number: int


@dataclass(frozen=True, slots=True)
class OutcomeReceived(Event):
    """An inspection's outcome."""

    outcome: Outcome


@dataclass(frozen=True, slots=True)
class OutcomeFailed(Event):
    """`RequestOutcome` got no answer, or an unusable one."""

    sequence: int
    what: str
    """For the log."""


class ShuttingDown(Event):
    """This process ends: it reports offline to the PLC, and begins no inspection any more."""


@dataclass(frozen=True, slots=True)
class RequestFailed(Event):
    """Another request got no answer, or an unusable one."""

    what: str
    """For the log."""


@dataclass(frozen=True, slots=True)
class OpenAnswered(Event):
    """The station's answer to `RequestOpen` with this number."""

    number: int
    opened: Open


@dataclass(frozen=True, slots=True)
class OutcomeNoted(Event):
    """The station has durably stored the outcome published under this sequence."""

    sequence: int


@dataclass(frozen=True, slots=True)
class CommandAnswered(Event):
    """The station's answer to `RequestCommand` with this number."""

    number: int
    done: bool
    why: str


@dataclass(frozen=True, slots=True)
class CommandFailed(Event):
    """`RequestCommand` got no answer in time; whether it was carried out is unknown."""

    number: int
