"""A play of the handshake drawn from a seed: at each step what the PLC reads, and what the interface does."""

from dataclasses import fields, is_dataclass, replace
from random import Random
from typing import Any

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.machine import next_due_s, step
from plc_interface.handshake.state import restarted
from plc_interface.handshake.view import line, view
from station.channel.line import BeginReply, Open, Outcome, PackmlState, Reason, Refusal, StationState
from station.settings.plc import HandshakeSettings
from station.vocabulary import OutcomeName

STEPS = 220
_BITS = ("enable", "buffer_results", "latch_lot", "offline", "clear_error", "reset_counters")
_WAITS_S = (0.01, 0.01, 0.05, 0.2, 0.9, 2.5, 6.0)


class Play:
    """The handshake with a PLC and a station that mostly do what they should."""

    def __init__(self, seed: int) -> None:
        self.rng, self.now_s, self.settings = Random(seed), 100.0, HandshakeSettings()
        self.state = restarted(Journal(), self.at(), self.settings.station_lost_after_s)
        self.inputs, self.boot, self.sequence, self.trigger_id, self.command = ev.Inputs(), 1, 40, 0, 0
        self.up: set[str] = set()
        self.seen = self.read()
        self.lines: list[str] = []

    def at(self) -> ev.Moment:
        return ev.Moment(self.now_s, round(1000 * self.now_s))

    def read(self) -> dict[str, Any]:
        """Everything that the interface shows of its state."""
        shown = line(self.state, {"count_bad_requests": 3}, ())
        return view(self.state) | {"line": _plain(shown), "due": next_due_s(self.state)}

    def run(self) -> list[str]:
        """Play, and return a line for each step."""
        for _ in range(STEPS):
            self.now_s = round(self.now_s + self.rng.choice(_WAITS_S[: self.rng.choice((3, 3, 3, 5, 7))]), 3)
            event = self.event()
            if self.rng.random() < 0.01:
                self.state = restarted(self.state.journal, self.at(), self.settings.station_lost_after_s)
                self.up = set()
            self.state, actions = step(self.state, event, self.settings)
            now = self.read()
            changed = {name: value for name, value in now.items() if value != self.seen.get(name)}
            self.seen = now
            did = "; ".join(_plain(action) for action in actions)
            self.lines.append(f"{self.now_s:.3f} {_plain(event)} | {did} | {changed}")
        return self.lines

    def event(self) -> ev.Event:
        """Draw what happens next: mostly what is waited for."""
        if (answer := self.answer()) is not None:
            return answer
        drawn = self.rng.random()
        if drawn < 0.16:
            self.boot += self.rng.random() < 0.05
            return ev.Beat(self.at(), self.station(), self.at().s)
        return self.rare() if drawn < 0.26 else self.write()

    def answer(self) -> ev.Event | None:
        """Draw an answer to what the handshake waits for; None for none yet."""
        state, rng, at, event = self.state, self.rng, self.at(), None
        if not state.writer and rng.random() < 0.5:
            self.up = set()
            event = ev.WriterGranted(at)
        elif state.open_request is not None and rng.random() < 0.8:
            event = ev.OpenAnswered(at, state.open_request + rng.choice((0, 0, 0, 0, 1)), self.opened())
        elif state.command_request is not None and rng.random() < 0.1:
            event = ev.CommandFailed(at, state.command_request)
        elif state.command_request is not None and rng.random() < 0.5:
            event = ev.CommandAnswered(at, state.command_request, done=rng.random() < 0.7, why="")
        elif state.pending is not None and rng.random() < 0.6:
            event = self.begin_answered(state.pending.number)
        elif state.running is not None and rng.random() < 0.4:
            event = ev.OutcomeReceived(at, self.outcome(state.running.sequence, state.running.trigger_id))
        return event

    def rare(self) -> ev.Event:
        """Draw what seldom happens."""
        at, state, rng = self.at(), self.state, self.rng
        sequence = state.running.sequence if state.running else self.sequence
        return rng.choice((
            ev.Tick(at),
            ev.Tick(at),
            ev.WriterWithdrawn(at),
            ev.OutputChanged(at, ready=rng.random() < 0.8),
            ev.RequestFailed(at, "a note"),
            ev.OutcomeFailed(at, sequence, "no answer"),
            ev.OutcomeNoted(at, sequence),
            ev.OutcomeReceived(at, self.outcome(rng.choice((sequence, 41)), 9)),
            ev.BeginFailed(at, 3),
            ev.ShuttingDown(at) if rng.random() < 0.1 else ev.Tick(at),
        ))  # fmt: skip

    def begin_answered(self, number: int) -> ev.Event:
        """Draw the answer to a trigger."""
        drawn = self.rng.random()
        if drawn < 0.1:
            return ev.BeginFailed(self.at(), number)
        if drawn < 0.25:
            refusal = self.rng.choice((Refusal.NOT_READY, Refusal.BUSY, Refusal.RECORDS_FULL))
            return ev.BeginAnswered(self.at(), number, BeginReply(refusal=refusal))
        self.sequence += drawn < 0.95
        return ev.BeginAnswered(self.at(), number, BeginReply(sequence=self.sequence, deadline_s=2.0 + 2 * drawn))

    def opened(self) -> Open:
        """Draw what the station holds open."""
        rng, running = self.rng, self.state.running
        if running is not None and rng.random() < 0.6:
            return Open(running=(running.sequence, running.trigger_id), outcomes=())
        if rng.random() < 0.3:
            self.sequence += 1
            return Open(running=(self.sequence, max(1, self.trigger_id)), outcomes=())
        if rng.random() < 0.5:
            return Open(running=None, outcomes=(self.outcome(rng.choice((self.sequence, self.sequence + 1)), 5),))
        return Open(running=None, outcomes=())

    def station(self) -> StationState:
        """Draw the station's state."""
        rng = self.rng
        return StationState(
            boot=str(self.boot),
            healthy=rng.random() < 0.9,
            ready=rng.random() < 0.9,
            why_not_ready=None,
            packml_state=rng.choice((None, *PackmlState)),
            mode=1,
            recipe_number=rng.choice((3, 3, 4)),
            recipe_checksum=77,
            error_code=rng.choice((0, 0, 0, 12)),
            alarms=rng.choice((0, 0, 5, 1 << 40)),
            simulated=rng.random() < 0.5,
        )

    def outcome(self, sequence: int, trigger_id: int) -> Outcome:
        """Draw an outcome, seldom one that contradicts itself."""
        rng = self.rng
        name: OutcomeName = rng.choice(("PASS", "PASS", "FAIL", "NO_RESULT"))
        known = name != "NO_RESULT"
        return Outcome(
            sequence=sequence,
            trigger_id=trigger_id,
            outcome=name,
            reasons=() if name == "PASS" and rng.random() < 0.9 else (Reason.NEAR_LIMIT,),
            late=rng.random() < 0.1,
            partial=rng.random() < 0.2,
            simulated=rng.random() < 0.5,
            area_mm2=rng.choice((12.34, 3e7, 1e39)) if known else None,
            area_px=rng.choice((1234, 2**32)) if known else None,
            closing_mm=rng.choice((3.004, 400.0, -400.0)) if known else None,
            confidence=rng.choice((0.904, None)),
            recipe_number=3,
            recipe_checksum=77,
            began_utc_ms=1,
            ended_utc_ms=2,
            duration_ms=1,
            encoder=5,
            lot=rng.choice(("", "L1")),
            fruit_length_mm_x10=480,
            size_class=3,
        )

    def write(self) -> ev.Event:
        """Draw a write of the PLC: one or two changes that a program would make, or a mistake."""
        rng, state = self.rng, self.state
        values: dict[str, Any] = {"plc_heartbeat": self.inputs.plc_heartbeat + 1}
        if rng.random() < 0.15:
            self.up ^= {rng.choice(_BITS)}
        elif rng.random() < 0.8:
            self.up |= {"enable"}
        self.acknowledge(values)
        if state.trigger.value in {"low", "held"} and rng.random() < 0.6:
            self.trigger_id += rng.random() < 0.9
            self.up |= {"trigger"}
            values |= {"trigger_id": self.trigger_id, "encoder": 1000 + self.trigger_id}
            values |= {"fruit_length_mm_x10": 455, "size_class": 2} if rng.random() < 0.5 else {}
        elif rng.random() < 0.6:
            self.up -= {"trigger"}
        if rng.random() < 0.15:
            self.command += rng.random() < 0.8
            self.up |= {"execute_command"}
            code = rng.choice((0, 1, 2, 3, 9))
            values |= {"command_sequence": self.command, "command_code": code, "command_argument": 4}
        elif rng.random() < 0.5:
            self.up -= {"execute_command"}
        if rng.random() < 0.1:
            values["lot"] = rng.choice(("L1", "L2", None))
        self.inputs = replace(self.inputs, control=frozenset(self.up), **values)
        return ev.PlcWrote(self.at(), self.inputs, frozenset({"control", *values}))

    def acknowledge(self, values: dict[str, Any]) -> None:
        """Take the result that is shown, mostly as it should be done."""
        drawn, shown = self.rng.random(), self.seen["result_sequence"]
        if shown and drawn < 0.6:
            values["acknowledged_sequence"] = shown
            self.up |= {"acknowledge"} if drawn < 0.4 else set()
        elif drawn < 0.05:
            values["acknowledged_sequence"] = self.rng.choice((shown, 17))
            self.up |= {"acknowledge"}
        elif drawn < 0.8:
            self.up -= {"acknowledge"}


def _plain(value: Any) -> str:
    """A value by its type and fields, without those that are as always; sets in their order."""
    if isinstance(value, (do.Log, frozenset)):
        return f"Log({value.warning})" if isinstance(value, do.Log) else str(sorted(value))
    if hasattr(value, "model_dump"):
        return f"{type(value).__name__}({_pairs(value.model_dump(mode='json', exclude_defaults=True))})"
    if is_dataclass(value):
        shown = {field.name: getattr(value, field.name) for field in fields(value) if field.name != "at"}
        return f"{type(value).__name__}({_pairs(shown)})"
    return str(value)


def _pairs(values: dict[str, Any]) -> str:
    return ", ".join(f"{name}={_plain(value)}" for name, value in values.items())
