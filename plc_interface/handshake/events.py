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
    """None where the registers do not hold printable ASCII."""
    fruit_length_mm_x10: int = 0
    size_class: int = 0


@dataclass(frozen=True, slots=True)
class PlcWrote:
    """The writer wrote into the control block; the named registers hold new values, or the same again."""

    at: Moment
    inputs: Inputs
    written: frozenset[str]


@dataclass(frozen=True, slots=True)
class WriterGranted:
    """A client got the right to write."""

    at: Moment


@dataclass(frozen=True, slots=True)
class WriterWithdrawn:
    """The client with the right to write closed, died, or released it."""

    at: Moment


@dataclass(frozen=True, slots=True)
class Tick:
    """Only time has passed."""

    at: Moment


@dataclass(frozen=True, slots=True)
class Beat:
    """The station answered a beat."""

    at: Moment
    station: StationState


@dataclass(frozen=True, slots=True)
class OutputChanged:
    """The line's output can, or cannot, divert a fruit now."""

    at: Moment
    ready: bool


@dataclass(frozen=True, slots=True)
class BeginAnswered:
    """The station's answer to `RequestBegin` with this number."""

    at: Moment
    number: int
    begun: BeginReply


@dataclass(frozen=True, slots=True)
class BeginFailed:
    """`RequestBegin` got no answer; whether it was carried out is unknown."""

    at: Moment
    number: int


@dataclass(frozen=True, slots=True)
class OutcomeReceived:
    """An inspection's outcome."""

    at: Moment
    outcome: Outcome


@dataclass(frozen=True, slots=True)
class OutcomeFailed:
    """`RequestOutcome` got no answer, or an unusable one."""

    at: Moment
    sequence: int
    what: str
    """For the log."""


@dataclass(frozen=True, slots=True)
class ShuttingDown:
    """This process ends: it reports offline to the PLC, and begins nothing any more."""

    at: Moment


@dataclass(frozen=True, slots=True)
class RequestFailed:
    """Another request got no answer, or an unusable one."""

    at: Moment
    what: str
    """For the log."""


@dataclass(frozen=True, slots=True)
class OpenAnswered:
    """The station's answer to `RequestOpen` with this number."""

    at: Moment
    number: int
    opened: Open


@dataclass(frozen=True, slots=True)
class OutcomeNoted:
    """The station has durably stored the outcome published under this sequence."""

    at: Moment
    sequence: int


@dataclass(frozen=True, slots=True)
class CommandAnswered:
    """The station's answer to `RequestCommand` with this number."""

    at: Moment
    number: int
    done: bool
    why: str


@dataclass(frozen=True, slots=True)
class CommandFailed:
    """`RequestCommand` got no answer in time; whether it was carried out is unknown."""

    at: Moment
    number: int


Event = (
    PlcWrote
    | WriterGranted
    | WriterWithdrawn
    | Tick
    | Beat
    | OutputChanged
    | BeginAnswered
    | BeginFailed
    | OutcomeReceived
    | OutcomeFailed
    | RequestFailed
    | OpenAnswered
    | OutcomeNoted
    | CommandAnswered
    | CommandFailed
    | ShuttingDown
)
