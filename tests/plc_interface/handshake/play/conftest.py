"""The station that the random play talks to, and the laws that every step of the handshake has to keep."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import pytest

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import COMMAND_RESULT
from plc_interface.handshake.modes import Arming, Command, Link, Result
from plc_interface.handshake.state import Fault, State
from plc_interface.handshake.view import view
from plc_interface.registers.map import BY_NAME
from station.channel.line import BeginReply, Open, Outcome, PackmlState, Reason, Refusal, StationState
from station.settings.plc import HandshakeSettings

DEADLINE_S = 4.0
RECIPE = 3


def outcome(sequence: int, trigger_id: int, name: str = "PASS", *reasons: Reason) -> Outcome:
    """As a station judges it; each sequence has its own area."""
    return Outcome(
        sequence=sequence,
        trigger_id=trigger_id,
        outcome=name,  # pyrefly: ignore[bad-argument-type] (the model checks it)
        reasons=reasons,
        late=False,
        partial=name != "PASS",
        simulated=False,
        area_mm2=float(sequence) if name != "NO_RESULT" else None,
        area_px=sequence if name != "NO_RESULT" else None,
        closing_mm=1.0 if name != "NO_RESULT" else None,
        confidence=0.9,
        recipe_number=RECIPE,
        recipe_checksum=77,
        began_utc_ms=1,
        ended_utc_ms=2,
        duration_ms=1,
        encoder=0,
        lot="",
    )


@dataclass
class Inspection:
    """A station's record, which survives its restarts."""

    trigger_id: int
    judged: Outcome | None = None
    published: Outcome | None = None
    acknowledged: bool = False

    @property
    def standing(self) -> Outcome | None:
        return self.published or self.judged


@dataclass
class Station:
    """Durable records, and a process that can die."""

    records: dict[int, Inspection] = field(default_factory=dict)
    running: int | None = None
    jaws_closed: bool = False
    """On a fruit, until a while after its outcome; also over a kill."""
    waiting: set[int] = field(default_factory=set)
    boots: int = 1
    up: bool = True

    def restart(self) -> None:
        if self.running is not None:
            record = self.records[self.running]
            record.judged = outcome(self.running, record.trigger_id, "NO_RESULT", Reason.STATION_LOST)
        self.running = None
        self.waiting.clear()
        self.boots += 1
        self.up = True

    @property
    def packml_state(self) -> PackmlState:
        if self.running is not None:
            return PackmlState.EXECUTE
        return PackmlState.COMPLETING if self.jaws_closed else PackmlState.IDLE

    def state(self) -> StationState:
        return StationState(
            boot=f"boot {self.boots}",
            healthy=True,
            ready=self.running is None,
            why_not_ready=None,
            packml_state=self.packml_state,
            mode=1,
            recipe_number=RECIPE,
            recipe_checksum=77,
            error_code=0,
            alarms=0,
            simulated=False,
        )

    def begin(self, trigger_id: int) -> BeginReply:
        if self.running is not None:
            return BeginReply(refusal=Refusal.BUSY)
        sequence = max(self.records, default=100) + 1
        self.records[sequence] = Inspection(trigger_id)
        self.running = sequence
        self.jaws_closed = True
        return BeginReply(sequence=sequence, deadline_s=DEADLINE_S)

    def judge(self, name: str) -> None:
        assert self.running is not None
        record = self.records[self.running]
        reasons = () if name == "PASS" else (Reason.AREA_OVER_LIMIT,)
        record.judged = outcome(self.running, record.trigger_id, name, *reasons)
        self.running = None

    def publish(self, published: Outcome) -> None:
        record = self.records[published.sequence]
        record.published = published
        if self.running == published.sequence:
            self.running = None

    def open(self) -> Open:
        running = None if self.running is None else (self.running, self.records[self.running].trigger_id)
        ended = [
            record.standing
            for record in self.records.values()
            if not record.acknowledged and record.standing is not None
        ]
        return Open(running=running, outcomes=tuple(ended))


FORGOTTEN = {
    "trigger_acknowledged": ("trigger", Fault.TRIGGER_NOT_RESET),
    "lot_latched": ("latch_lot", Fault.LATCH_NOT_RESET),
    "command_done": ("execute_command", Fault.EXECUTE_NOT_RESET),
    "command_failed": ("execute_command", Fault.EXECUTE_NOT_RESET),
}
"""Bits that stand no longer than the handshake's time-out: the PLC's bit that takes them back, and the fault if not."""


class Laws:
    """Laws that every step of the handshake keeps, by what came in and what can be seen, not by its table's rows."""

    def __init__(self, settings: HandshakeSettings) -> None:
        self.settings = settings
        self.boot, self.boots = "", 0
        self.heard_s: float | None = None
        self.plc_beat_s: float | None = None
        self.plc_beat: int | None = None
        self.since_s: dict[str, float] = {}

    def hold(self, event: ev.Event, before: State, after: State, actions: Sequence[do.Action]) -> None:
        """Compare one step with all of them."""
        now_s = event.at.s
        due = any(due_s <= now_s for due_s in before.timers.values())
        silent = self.heard_s is not None and now_s >= self.heard_s + self.settings.station_lost_after_s
        self.heard_s = None if silent else self.heard_s
        self._link(event, before, after, actions, silent=silent)
        self._commands(event, before, after, actions, silent=silent)
        self._enable(event, before, after, actions)
        self._bits_fall_in_time(event, before, after, actions)
        self._acknowledgement(event, before, after, due=due)
        self._acquiring(event, before, after)
        self._readiness(event, before, after)
        self._counters(before, after)

    def _link(self, event: ev.Event, before: State, after: State, actions: Any, *, silent: bool) -> None:
        open_requests = [action for action in actions if isinstance(action, do.RequestOpen)]
        up = before.link is Link.UP and not silent
        beats = False
        if isinstance(event, ev.Beat):
            self.heard_s = event.at.s
            new = event.station.boot != self.boot
            self.boot, self.boots = event.station.boot, self.boots + new
            beats = up and not new
            if new:
                assert open_requests, "no request for what is open after a new start of the station"
                assert after.link is Link.RESUMING
            elif not up:
                assert after.open_request is not None, "no request for what is open to a station that is heard again"
                assert not open_requests or silent or before.open_request is None, "two requests at once"
        elif silent:
            assert (after.link, after.open_request) == (Link.LOST, None)
        elif isinstance(event, ev.RequestFailed):
            assert after.link is not Link.UP
            assert after.open_request is None, "a failed request is repeated"
        elif isinstance(event, ev.OpenAnswered) and event.number == before.open_request:
            assert (after.link, after.open_request) == (Link.UP, None)
        elif isinstance(event, ev.BeginAnswered) and before.pending and before.pending.number == event.number:
            assert open_requests or not up or event.begun.refusal is not Refusal.BUSY, "no request for what is open"
        seen = view(after)
        assert seen["station_heartbeat"] == (before.heartbeat + beats) % 2**16
        assert seen["station_boots"] == self.boots
        assert seen["active_recipe"] == (0 if self.heard_s is None else RECIPE), "a lost station's words are used"

    def _commands(self, event: ev.Event, before: State, after: State, actions: Any, *, silent: bool) -> None:
        is_requested = any(isinstance(action, do.RequestCommand) for action in actions)
        assert is_requested == (after.command_request not in {before.command_request, None}), (
            "a command is not carried out"
        )
        assert is_requested or after.command is before.command or after.command is not Command.EXECUTING
        result = after.journal.command_result
        mine = before.command_request is not None
        if before.command is Command.EXECUTING and (
            silent or (isinstance(event, ev.Beat) and before.last_boot != self.boot)
        ):
            assert (after.command, result) == (Command.FAILED, COMMAND_RESULT.code("station_lost"))
        elif isinstance(event, ev.CommandAnswered) and mine and event.number == before.command_request:
            expected = (Command.DONE, "done") if event.done else (Command.FAILED, "failed")
            assert (after.command, result) == (expected[0], COMMAND_RESULT.code(expected[1]))
        elif isinstance(event, ev.CommandFailed) and mine and event.number == before.command_request:
            assert (after.command, result) == (Command.FAILED, COMMAND_RESULT.code("timed_out"))
        elif self._rises(event, before, "execute_command"):
            self._command_given(event.inputs, before, after)  # pyrefly: ignore[missing-attribute] (`_rises` checks)

    def _command_given(self, inputs: ev.Inputs, before: State, after: State) -> None:
        journal = before.journal
        new = inputs.command_sequence != journal.command_sequence
        other = (inputs.command_code, inputs.command_argument) != (journal.command_code, journal.command_argument)
        if before.command is Command.EXECUTING:
            assert not (new or other) or Fault.COMMAND_BUSY in after.faults
        elif not new and other:
            assert Fault.COMMAND_REUSED in after.faults
            assert (after.command, after.journal.command_result) == (Command.FAILED, COMMAND_RESULT.code("failed"))
        elif new:
            assert after.journal.command_sequence == inputs.command_sequence
            good = inputs.command_code in BY_NAME["command_code"].codes and inputs.command_code != 0
            name = "no_command" if not good else "executing" if before.link is Link.UP else "station_lost"
            assert after.journal.command_result == COMMAND_RESULT.code(name)
            assert after.command is (Command.EXECUTING if name == "executing" else Command.FAILED)

    def _enable(self, event: ev.Event, before: State, after: State, actions: Any) -> None:
        plc_silent = (
            self.plc_beat_s is not None
            and event.at.s >= self.plc_beat_s + self.settings.plc_heartbeat_timeout_s
        )  # fmt: skip
        if plc_silent:
            self.plc_beat_s = None
            assert Fault.PLC_SILENT in after.faults or self._cleared(actions)
            assert after.arming is not Arming.ARMED or isinstance(event, ev.PlcWrote)
        if isinstance(event, ev.WriterWithdrawn):
            self.plc_beat_s = self.plc_beat = None
            assert after.arming is not Arming.ARMED
            assert after.counters["count_communication"] > before.counters["count_communication"]
            assert before.arming is not Arming.ARMED or plc_silent or Fault.WRITER_LOST in after.faults
        elif isinstance(event, ev.PlcWrote):
            if "plc_heartbeat" in event.written:
                if self.plc_beat not in {None, event.inputs.plc_heartbeat}:
                    self.plc_beat_s = event.at.s
                self.plc_beat = event.inputs.plc_heartbeat
            assert before.arming in {Arming.RELEASED, Arming.ARMED} or after.arming is not Arming.ARMED, "without anew"
            if "control" in event.written and "enable" not in event.inputs.control:
                assert after.arming is Arming.RELEASED
            elif "control" in event.written and before.arming is Arming.RELEASED:
                assert after.arming is Arming.ARMED

    def _bits_fall_in_time(self, event: ev.Event, before: State, after: State, actions: Any) -> None:
        now_s, seen = event.at.s, view(after)["status"]
        assert isinstance(seen, int)
        for name, (bit, fault) in FORGOTTEN.items():
            began_s, shown = self.since_s.get(name), seen & BY_NAME["status"].flags([name])
            if began_s is not None and now_s >= began_s + self.settings.handshake_timeout_s:
                del self.since_s[name]
                forgotten = bit in (before.seen or ())
                assert not forgotten or fault in after.faults or self._cleared(actions), f"{fault.name} is not reported"
                assert not shown or self._rises(event, before, bit), f"{name} stays on"
            if not shown:
                self.since_s.pop(name, None)
            elif name not in self.since_s or self._rises(event, before, bit):
                self.since_s[name] = now_s

    def _acknowledgement(self, event: ev.Event, before: State, after: State, *, due: bool) -> None:
        now_s = event.at.s
        if isinstance(event, ev.PlcWrote) and "control" in event.written:
            assert after.result is not Result.WITHHELD, "the PLC has written what it has taken"
        if after.queue and after.result not in {Result.PUBLISHED, Result.WITHHELD}:
            assert now_s < self.since_s.setdefault("waiting", now_s) + self.settings.handshake_timeout_s
        else:
            self.since_s.pop("waiting", None)
        if before.result is Result.TAKEN and after.result is not Result.TAKEN and "acknowledge" in (after.seen or ()):
            assert Fault.ACKNOWLEDGE_NOT_RESET in after.faults
        if due:
            return
        if after.result is Result.PUBLISHED and (
            before.result is not Result.PUBLISHED or before.published != after.published
        ):
            assert after.toggle != before.toggle
        if self._rises(event, before, "acknowledge") and before.seen is not None:
            sequence = event.inputs.acknowledged_sequence  # pyrefly: ignore[missing-attribute] (`_rises` checks)
            shown = before.queue[0].sequence if before.queue else 0
            if sequence not in {shown, before.unconfirmed}:
                assert Fault.WRONG_ACKNOWLEDGEMENT in after.faults

    @staticmethod
    def _acquiring(event: ev.Event, before: State, after: State) -> None:
        word = view(after)["status"]
        assert isinstance(word, int)
        now = word & BY_NAME["status"].flags(["acquiring"])
        reports = event.station.packml_state if isinstance(event, ev.Beat) else None
        lost = before.pending is not None and after.pending is None and after.last_refusal is Refusal.STATION_LOST
        if after.running is not None or reports is PackmlState.EXECUTE or lost:
            assert now, "the fruit may be moved while the station may be at it"
        elif reports is not PackmlState.IDLE:
            assert now or not before.acquiring, "the fruit may be moved, and no beat has reported so"

    @staticmethod
    def _readiness(event: ev.Event, before: State, after: State) -> None:
        ready = after.station is not None and after.station.ready
        if (before.pending is not None and after.pending is None) or (before.running is None and after.running):
            assert not ready, "what the station reported before the trigger was answered passes for its readiness"
        if not isinstance(event, ev.Beat):
            assert not ready or (before.station is not None and before.station.ready), "no beat has reported so"

    def _counters(self, before: State, after: State) -> None:
        counters = after.counters
        assert counters["count_triggers"] == counters["count_accepted"] + counters["count_missed"]
        if after.journal.epoch != before.journal.epoch:
            return
        new = {outcome.sequence for outcome in after.queue} - {outcome.sequence for outcome in before.queue}
        outcomes = ("count_pass", "count_fail", "count_no_result")
        assert sum(counters[name] - before.counters[name] for name in outcomes) == len(new)
        if set(after.faults) - set(before.faults):
            assert counters["count_communication"] > before.counters["count_communication"]

    @staticmethod
    def _rises(event: ev.Event, before: State, bit: str) -> bool:
        written = isinstance(event, ev.PlcWrote) and "control" in event.written and bit in event.inputs.control
        return written and bit not in (before.seen or ())

    @staticmethod
    def _cleared(actions: Any) -> bool:
        return any(isinstance(action, do.ClearFaults) for action in actions)


@pytest.fixture(scope="session")
def station_model() -> type[Station]:
    return Station


@pytest.fixture(scope="session")
def laws() -> type[Laws]:
    return Laws
