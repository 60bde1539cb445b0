"""One step in progress, and the definition of a row of the table."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

from plc_interface.handshake.actions import Action, Log
from plc_interface.handshake.events import Event, Moment
from plc_interface.handshake.modes import Mode, Signal
from plc_interface.handshake.state import NO_SIZE, Fault, Size, State
from station.channel.line import Outcome
from station.messages.message import Message
from station.settings.plc import HandshakeSettings


@dataclass(slots=True)
class Work:
    """A state during a step, for effects, with the event, its time and the settings."""

    state: State
    at: Moment
    event: Event
    settings: HandshakeSettings
    actions: list[Action] = field(default_factory=list)
    signals: deque[Signal] = field(default_factory=deque)
    durable: bool = False
    """Whether the journal has news that is stored nowhere else, and that has to survive a loss of power."""
    found: Outcome | None = None
    """The outcome that the signal OUTCOME or FOREIGN_OUTCOME is about."""
    size: Size = NO_SIZE
    """The fruit's size of the trigger of signal TRIGGER_ON."""

    def update_journal(self, **changes: Any) -> None:
        """Change the journal; it is written before the PLC reads the consequences."""
        self.state.journal = self.state.journal.model_copy(update=changes)

    def count(self, *names: str) -> None:
        """Increment counters; they wrap round at 2³²."""
        counters = dict(self.state.counters)
        for name in names:
            counters[name] = (counters[name] + 1) % 2**32
        self.state.counters = counters

    def fault(self, fault: Fault) -> None:
        """Count, log and latch a handshake fault."""
        self.count("count_communication")
        self.log(fault.message)
        if fault not in self.state.faults:
            self.state.faults = (*self.state.faults, fault)

    def log(self, text: Message | str, *, warning: bool = True) -> None:
        """Write one line into the log."""
        self.actions.append(Log(text, warning))

    def start(self, timer: Signal, after_s: float) -> None:
        """Start or restart a timer."""
        self.state.timers = {**self.state.timers, timer: self.at.s + after_s}

    def watch_bit(self, timer: Signal) -> None:
        """Start the time-out of a bit of the handshake."""
        self.start(timer, self.settings.handshake_timeout_s)

    def stop(self, timer: Signal) -> None:
        """Stop a timer. Idempotent."""
        self.state.timers = {name: due_s for name, due_s in self.state.timers.items() if name != timer}

    def number(self) -> int:
        """Return a new number for a request."""
        self.state.numbers += 1
        return self.state.numbers


Guard = Callable[[Work], bool]
"""Its docstring is its condition in the printed table."""
Effect = Callable[[Work], None]
"""Its docstring is its line in the printed table."""
ResultT = TypeVar("ResultT")


def described(words: str, rule: Callable[[Work], ResultT]) -> Callable[[Work], ResultT]:
    """Return a guard or effect of one expression, with this text as its docstring."""
    rule.__doc__ = words
    return rule


class Row(NamedTuple):
    """One rule: in this mode, on this signal, if the guard holds: the effects in order, then the next mode.

    Of several rows for one pair the first whose guard holds is taken.
    """

    mode: Mode
    signal: Signal
    guard: Guard | None
    effects: tuple[Effect, ...]
    next: Mode


def row(mode: Mode, signal: Signal, *effects: Effect, to: Mode | None = None, when: Guard | None = None) -> Row:
    """Make a row; without `to` the mode is unchanged."""
    return Row(mode, signal, when, effects, mode if to is None else to)
