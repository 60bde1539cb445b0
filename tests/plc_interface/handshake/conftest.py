"""The pure handshake with a clock that a test sets."""

from dataclasses import replace
from typing import Any

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.machine import step
from plc_interface.handshake.state import restarted
from station.channel.line import (
    Begin,
    BeginReply,
    Open,
    Outcome,
    Reason,
    StationState,
)
from station.settings.plc import HandshakeSettings
from tests.plc_interface.scripted_station import ScriptedStation


class Bench:
    """The pure handshake with a clock that a test sets; answers are given by hand."""

    def __init__(self, journal: Journal | None = None) -> None:
        self.now_s = 100.0
        self.settings = HandshakeSettings()
        self.state = restarted(journal or Journal(), self.at(), self.settings.station_lost_after_s)
        self.inputs = ev.Inputs()
        self.actions: list[do.Action] = []

    def at(self) -> ev.Moment:
        return ev.Moment(self.now_s, round(1000 * self.now_s))

    def feed(self, kind: Any, *arguments: Any, **named: Any) -> tuple[do.Action, ...]:
        self.state, actions = step(self.state, kind(self.at(), *arguments, **named), self.settings)
        self.actions += actions
        return actions

    def write(self, *bits: str, **values: Any) -> tuple[do.Action, ...]:
        """The control bits as they are to be now, and other fields."""
        self.inputs = replace(self.inputs, control=frozenset(bits), **values)
        return self.feed(ev.PlcWrote, self.inputs, frozenset({"control", *values}))

    def station_state(self, **changes: Any) -> StationState:
        state = StationState(
            boot="1",
            healthy=True,
            ready=True,
            why_not_ready=None,
            packml_state=None,
            mode=1,
            recipe_number=0,
            recipe_checksum=0,
            error_code=0,
            alarms=0,
            simulated=False,
        )
        return state.model_copy(update=changes)

    def link(self, opened: Open | None = None, **changes: Any) -> tuple[do.Action, ...]:
        """A beat, and the answer to its request."""
        self.beat(**changes)
        assert self.state.open_request is not None
        return self.feed(ev.OpenAnswered, self.state.open_request, opened or Open(running=None, outcomes=()))

    def beat(self, *, asked_s: float | None = None, **changes: Any) -> tuple[do.Action, ...]:
        """The station's state, by a beat that was sent just now or at another time."""
        return self.feed(ev.Beat, self.station_state(**changes), self.now_s if asked_s is None else asked_s)

    def armed(self, *bits: str) -> None:
        self.feed(ev.WriterGranted)
        self.link()
        self.write()
        self.write("enable", *bits)

    def run(self, trigger_id: int = 7, sequence: int = 41) -> None:
        """An accepted trigger."""
        self.armed()
        self.write("enable", "trigger", trigger_id=trigger_id)
        assert self.state.pending is not None
        self.feed(ev.BeginAnswered, self.state.pending.number, BeginReply(sequence=sequence, deadline_s=2.0))

    def of(self, kind: type[Any]) -> list[Any]:
        return [action for action in self.actions if isinstance(action, kind)]

    def outcome(self, name: str = "PASS", *reasons: Reason, **changes: Any) -> Outcome:
        running = ScriptedStation("")
        running.running, running.accepted = 41, {41: Begin(trigger_id=7, encoder=0, lot="")}
        return running.finish(name, *reasons, **changes)


@pytest.fixture
def bench() -> type[Bench]:
    return Bench
