"""Actions of the handshake on its surroundings, in the order given."""

from dataclasses import dataclass

from plc_interface.handshake.journal import Journal
from station.channel.line import CommandName, Outcome


@dataclass(frozen=True, slots=True)
class Keep:
    """Write the journal before the PLC sees the new registers."""

    journal: Journal
    durable: bool
    """Also over a loss of power; otherwise over the end of this process is enough."""


@dataclass(frozen=True, slots=True)
class AskBegin:
    """Send `Begin`; answer with BeginAnswered or BeginFailed."""

    number: int
    trigger_id: int
    encoder: int
    lot: str
    fruit_length_mm_x10: int
    size_class: int


@dataclass(frozen=True, slots=True)
class AskOutcome:
    """Send `AwaitOutcome`; answer with OutcomeCame or RequestFailed."""

    sequence: int
    within_s: float


@dataclass(frozen=True, slots=True)
class AskOpen:
    """Send `Resume`; answer with OpenTold or RequestFailed."""

    number: int


@dataclass(frozen=True, slots=True)
class AskCommand:
    """Send `Command`; answer with CommandAnswered or CommandFailed."""

    number: int
    command: CommandName
    argument: int


@dataclass(frozen=True, slots=True)
class TellPublished:
    """Send `Published` after earlier notes; answer with OutcomeNoted or RequestFailed."""

    outcome: Outcome


@dataclass(frozen=True, slots=True)
class TellAcknowledged:
    """Send `Acknowledged` after earlier notes; a failure is answered with RequestFailed."""

    sequence: int


@dataclass(frozen=True, slots=True)
class PassOn:
    """Give a new outcome to the line's outputs."""

    outcome: Outcome


@dataclass(frozen=True, slots=True)
class ClearFaults:
    """Clear the faults of the line's outputs."""


@dataclass(frozen=True, slots=True)
class Say:
    """Write one line into the log."""

    text: str
    warning: bool = True


Action = (
    Keep | AskBegin | AskOutcome | AskOpen | AskCommand | TellPublished | TellAcknowledged | PassOn | ClearFaults | Say
)
