"""PLC interface on the simulated clock: the real handshake, its journal in memory, and the channel to the station."""

import random
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.machine import next_due_s, step
from plc_interface.handshake.state import restarted
from plc_interface.handshake.view import view
from plc_interface.registers.codec import decode, encode
from plc_interface.registers.map import BY_NAME, MORE_STATUS, RESULT, STATUS
from station.channel.line import BeginReply, Outcome
from station.settings.plc import HandshakeSettings

from .clock import Clock, Timer
from .devices import Devices
from .laws import Laws
from .station import Station

SETTINGS = HandshakeSettings(beat_period_s=0.3)
_CONTROL = BY_NAME["control"]
_INVALID = {
    register.name: decode(register, encode(register, None))
    for register in (*STATUS, *RESULT, *MORE_STATUS)
    if register.invalid is not None
}
_LOST_SHARE = 0.3
_OUTCOME_GRACE_S = 1.0


@dataclass(slots=True)
class Machine:
    """Parts that outlive the interface's process: the journal among them."""

    clock: Clock
    rng: random.Random
    devices: Devices
    laws: Laws
    station: Station
    journal: Journal


class Interface:
    """One process of the PLC interface, from its start to its kill."""

    def __init__(self, machine: Machine) -> None:
        self.alive = True
        self._machine, self._clock = machine, machine.clock
        self._state = restarted(machine.journal, self._at(), SETTINGS.station_lost_after_s)
        self.registers: dict[str, Any] = {"result_deadline_ms": 0}
        self._inputs = ev.Inputs()
        self._notes: deque[do.NotifyPublished | do.NotifyAcknowledged] = deque()
        self._timer: Timer | None = None
        self._due_s: float | None = None
        self._before = machine.journal
        self._save(self._state.journal)
        self._publish()
        self._wake_when_due()
        self._beat()

    @property
    def has_writer(self) -> bool:
        """True while the PLC has the right to write."""
        return self._state.writer

    def kill(self) -> None:
        """End the process."""
        self.alive = False

    def connect(self) -> None:
        """Let the PLC write."""
        self.feed(ev.WriterGranted(self._at()))

    def disconnect(self) -> None:
        """Lose the PLC's connection."""
        self.feed(ev.WriterWithdrawn(self._at()))

    def write(self, values: dict[str, Any]) -> None:
        """Take the PLC's control block."""
        known = {name: value for name, value in values.items() if name != "write_key"}
        known["control"] = _CONTROL.names(known["control"])
        self._inputs = ev.Inputs(**known)
        self.feed(ev.PlcWrote(self._at(), self._inputs, frozenset(known)))

    def feed(self, event: ev.Event) -> None:
        """Run one step: the journal first, then the registers, then everything else."""
        if not self.alive:
            return
        self._state, actions = step(self._state, event, SETTINGS)
        for action in actions:
            if isinstance(action, do.SaveJournal):
                self._save(action.journal)
        self._publish()
        for action in actions:
            self._carry_out(action)
        self._wake_when_due()

    def _save(self, journal: Journal) -> None:
        self._machine.journal = journal  # on a full disk too: it has a reserve
        before, self._before = self._before, journal
        if journal.highest == before.highest:
            return
        # A refused trigger's inspection uses up a sequence too. It never runs for the PLC or waits for it, and its id
        # is not stored as accepted. An accepted one that is lost at once has its id stored all the same.
        waiting = {each.sequence for each in (*journal.queue, journal.running) if each is not None}
        accepted = {sequence for sequence in waiting if sequence > before.highest}
        if not accepted and journal.accepted_id != before.accepted_id:
            accepted = {journal.highest}
        for sequence in accepted:
            self._machine.laws.accepted(sequence)

    def _publish(self) -> None:
        for name, value in view(self._state).items():
            self.registers[name] = _INVALID[name] if value is None else value
        self._machine.laws.seen(self.registers)

    def _wake_when_due(self) -> None:
        due_s = next_due_s(self._state)
        if due_s == self._due_s:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._due_s, self._timer = due_s, None
        if due_s is not None:
            self._timer = self._clock.after(max(0.0, due_s - self._clock.s), self._tick)

    def _tick(self) -> None:
        self._due_s = None
        self.feed(ev.Tick(self._at()))

    def _beat(self) -> None:
        if not self.alive:
            return
        asked_s = self._clock.s
        self._request(
            lambda answer: answer(self._machine.station.report()),
            SETTINGS.station_lost_after_s / 3,
            lambda state: self.feed(ev.Beat(self._at(), state, asked_s)),
            lambda: None,
        )
        self._clock.after(SETTINGS.beat_period_s, self._beat)

    def _carry_out(self, action: do.Action) -> None:
        station = lambda: self._machine.station  # noqa: E731 (the one that runs when the request arrives)
        failed = lambda: self.feed(ev.RequestFailed(self._at(), "no answer"))  # noqa: E731
        match action:
            case do.RequestBegin(number=number):

                def begin_answered(reply: BeginReply) -> None:
                    self.feed(ev.BeginAnswered(self._at(), number, reply))

                self._request(
                    lambda answer: station().begin(action.trigger_id, action.encoder, action.lot, answer),
                    SETTINGS.begin_deadline_s,
                    begin_answered,
                    lambda: self.feed(ev.BeginFailed(self._at(), number)),
                )
            case do.RequestOutcome(sequence=sequence, within_s=within_s):

                def received(outcome: Outcome) -> None:
                    self.feed(ev.OutcomeReceived(self._at(), outcome))

                self._request(
                    lambda answer: station().await_outcome(sequence, answer),
                    within_s + _OUTCOME_GRACE_S,
                    received,
                    lambda: self.feed(ev.OutcomeFailed(self._at(), sequence, "no answer")),
                )
            case do.RequestOpen(number=number):
                self._request(
                    lambda answer: answer(station().open()),
                    SETTINGS.station_lost_after_s,
                    lambda opened: self.feed(ev.OpenAnswered(self._at(), number, opened)),
                    failed,
                )
            case do.NotifyPublished() | do.NotifyAcknowledged():
                self._notes.append(action)
                if len(self._notes) == 1:
                    self._note()
            case _:
                pass

    def _note(self) -> None:
        """Send the oldest note; the next one after its answer."""
        note = self._notes[0]

        def deliver(answer: Callable[[None], None]) -> None:
            station = self._machine.station
            if isinstance(note, do.NotifyPublished):
                taken = station.published(note.outcome)
            else:
                taken = station.acknowledged(note.sequence)
            if taken:
                answer(None)

        def noted(_: None) -> None:
            self._notes.popleft()
            if isinstance(note, do.NotifyPublished):
                self.feed(ev.OutcomeNoted(self._at(), note.outcome.sequence))
            if self._notes:
                self._note()

        def lost() -> None:
            self._notes.clear()
            self.feed(ev.RequestFailed(self._at(), "a note"))

        self._request(deliver, SETTINGS.station_lost_after_s, noted, lost)

    def _request(
        self,
        submit: Callable[[Callable[[Any], None]], Any],
        within_s: float,
        answered: Callable[[Any], None],
        failed: Callable[[], None],
    ) -> None:
        """Send a request over the channel, whose troubles delay or lose it or its answer."""
        settled: list[bool] = []
        timer = self._clock.after(within_s, partial(self._settle, settled, failed))
        deadline_s = self._clock.s + within_s

        def answer(value: Any) -> None:
            def arrive() -> None:
                timer.cancel()
                self._settle(settled, partial(answered, value))

            if (delay_s := self._way_s()) is not None:
                self._clock.after(delay_s, arrive)

        def arrived() -> None:
            if self._machine.station.alive and self._clock.s < deadline_s:  # the channel's server drops a later one
                submit(answer)

        if (delay_s := self._way_s()) is not None:
            self._clock.after(delay_s, arrived)

    def _settle(self, settled: list[bool], what: Callable[[], None]) -> None:
        if self.alive and not settled:
            settled.append(True)
            what()

    def _way_s(self) -> float | None:
        """Return how long a message is on its way; None where it is lost."""
        kind, rng = self._machine.devices.trouble("channel"), self._machine.rng
        if kind == "off" or (kind == "intermittent" and rng.random() < _LOST_SHARE):
            return None
        return rng.uniform(0.0005, 0.002) + {"slow": 0.12, "delayed": 0.8}.get(kind or "", 0.0)

    def _at(self) -> ev.Moment:
        return ev.Moment(self._clock.s, round(1000 * self._clock.time()))
