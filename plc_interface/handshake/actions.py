"""Actions of the handshake on its surroundings, in the order given."""

from dataclasses import dataclass

from plc_interface.handshake.journal import Journal
from station.channel.line import CommandName, Outcome
from station.messages.message import Message


@dataclass(frozen=True, slots=True)
class Action:
    """Base of all actions."""


@dataclass(frozen=True, slots=True)
class SaveJournal(Action):
    """Write the journal before the PLC sees the new registers."""

    journal: Journal
    durable: bool
    """Also over a loss of power; otherwise over the end of this process is enough."""


@dataclass(frozen=True, slots=True)
class RequestBegin(Action):
    """Send `Begin`; answer with BeginAnswered or BeginFailed."""

    number: int
    trigger_id: int
    encoder: int
    lot: str
    fruit_length_mm_x10: int
    size_class: int


@dataclass(frozen=True, slots=True)
class RequestOutcome(Action):
    """Send `AwaitOutcome`; answer with OutcomeReceived or RequestFailed."""

    sequence: int
    within_s: float


@dataclass(frozen=True, slots=True)
class RequestOpen(Action):
    """Send `Resume`; answer with OpenAnswered or RequestFailed."""

    number: int


@dataclass(frozen=True, slots=True)
class RequestCommand(Action):
    """Send `Command`; answer with CommandAnswered or CommandFailed."""

    number: int
    command: CommandName
    argument: int


@dataclass(frozen=True, slots=True)
class NotifyPublished(Action):
    """Send `Published` after earlier notes; answer with OutcomeNoted or RequestFailed."""

    outcome: Outcome


@dataclass(frozen=True, slots=True)
class NotifyAcknowledged(Action):
    """Send `Acknowledged` after earlier notes; a failure is answered with RequestFailed."""

    sequence: int


@dataclass(frozen=True, slots=True)
class ForwardOutcome(Action):
    """Give a new outcome to the line's outputs."""

    outcome: Outcome


class ClearFaults(Action):
    """Clear the faults of the line's outputs."""


@dataclass(frozen=True, slots=True)
class Log(Action):
    """Write one line into the log."""

    text: Message | str
    warning: bool = True
