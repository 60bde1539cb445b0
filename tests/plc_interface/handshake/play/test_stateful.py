"""PLC, wire, interface and station played at random: messages lost, doubled, late and reordered, either side restarted.

Always: exactly one outcome for each accepted trigger, never a wrong id, never two different outcomes under
one sequence, and nothing valid that the station did not judge.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from plc_interface.handshake import actions as do
from plc_interface.handshake import events as ev
from plc_interface.handshake.journal import Journal
from plc_interface.handshake.machine import step
from plc_interface.handshake.modes import Arming, Link, Result
from plc_interface.handshake.state import HANDSHAKE_COUNTERS, Fault, State, restarted
from plc_interface.handshake.view import lot_checksum, view
from plc_interface.registers.map import BY_NAME
from station.settings.plc import HandshakeSettings

SETTINGS = HandshakeSettings()
STATUS = BY_NAME["status"]
SHORT_ORDERS = ("clear_error", "reset_counters", "offline", "latch_lot")


@dataclass
class Request:
    """A request on its way to the station, or waiting for its answer."""

    action: Any
    expires_s: float


@dataclass(frozen=True)
class AcknowledgementNoted:
    """The station's answer to `NotifyAcknowledged`, which the core does not receive."""

    at: ev.Moment
    sequence: int


class Handshake(RuleBasedStateMachine):
    """The world around `step`."""

    def __init__(self, make_station: Callable[[], Any], make_laws: Callable[[HandshakeSettings], Any]) -> None:
        super().__init__()
        self.make_station, self.make_laws = make_station, make_laws

    @initialize()
    def start(self) -> None:
        self.now_s, self.runs = 1000.0, 0
        self.station = self.make_station()
        self.disk = Journal()
        self.crash_after: int | None = None
        self.control: set[str] = set()
        self.inputs = ev.Inputs()
        self.next_id = 1
        self.refused: set[Any] = set()
        self.triggered_again: set[Any] = set()
        """Accepted ids that the PLC gave again: after a start that trigger may be refused as `station_lost`."""
        self.missed: tuple[Any, ...] = ()
        self.shown: dict[int, dict[str, Any]] = {}
        self.taken: set[int] = set()
        self.accepted: set[int] = set()
        self.commands: set[int | None] = set()
        self.boot()
        self.heal()
        self.rearm("")

    # the interface's process

    def boot(self) -> None:
        self.runs += 1
        self.to_station: list[Request] = []
        self.answers: list[ev.Event | AcknowledgementNoted] = []
        self.pending: list[Request] = []
        self.notes: list[Any] = []
        self.state: State = restarted(self.disk, self.at(), SETTINGS.station_lost_after_s)
        self.laws = self.make_laws(SETTINGS)
        self.seen = view(self.state)
        self.observe()
        self.feed(ev.WriterGranted(self.at()))

    def at(self) -> ev.Moment:
        return ev.Moment(self.now_s, round(1000 * self.now_s))

    def feed(self, event: ev.Event) -> None:
        before = copy.copy(self.state)
        after, todo = step(self.state, event, SETTINGS)
        assert self.state == before, "a step changed the state that it was given"
        self.laws.hold(event, before, after, todo)
        self.state = after
        keeps = [action for action in todo if isinstance(action, do.SaveJournal)]
        rest = [action for action in todo if not isinstance(action, do.SaveJournal)]
        for number, action in enumerate([*keeps, None, *rest]):
            if self.crash_after is not None and number >= self.crash_after:
                self.crash_after = None
                self.boot()
                return
            if action is None:
                self.seen = view(self.state)
                self.observe()
            else:
                self.carry_out(action)

    def carry_out(self, action: Any) -> None:
        match action:
            case do.SaveJournal(journal=journal):
                self.disk = Journal.model_validate_json(journal.model_dump_json())
            case do.RequestBegin():
                self.send(action, SETTINGS.begin_deadline_s)
            case do.RequestOutcome(within_s=within_s):
                self.send(action, within_s)
            case do.RequestOpen():
                self.send(action, 1.0)
            case do.RequestCommand():
                assert self.state.journal.command_sequence not in self.commands, "a command is carried out twice"
                self.commands.add(self.state.journal.command_sequence)
                self.send(action, 2.0)
            case do.NotifyPublished() | do.NotifyAcknowledged():
                self.notes.append(action)
                self.send_next_note()

    def send(self, action: Any, within_s: float) -> None:
        request = Request(action, self.now_s + within_s)
        self.to_station.append(request)
        self.pending.append(request)

    def send_next_note(self) -> None:
        is_sending = any(isinstance(r.action, do.NotifyPublished | do.NotifyAcknowledged) for r in self.pending)
        if self.notes and not is_sending:
            self.send(self.notes.pop(0), 1.0)

    def failed(self, request: Request) -> None:
        match request.action:
            case do.RequestBegin(number=number):
                self.feed(ev.BeginFailed(self.at(), number))
            case do.RequestCommand(number=number):
                self.feed(ev.CommandFailed(self.at(), number))
            case do.NotifyPublished() | do.NotifyAcknowledged():
                self.notes.clear()
                self.feed(ev.RequestFailed(self.at(), "a note"))
            case do.RequestOutcome(sequence=sequence):
                self.feed(ev.OutcomeFailed(self.at(), sequence, "no answer"))
            case _:
                self.feed(ev.RequestFailed(self.at(), "a question"))

    def deliver(self, event: ev.Event | AcknowledgementNoted) -> None:
        """An answer reaches the core, with the time at which it does; also one that is not waited for any more."""
        if isinstance(event, AcknowledgementNoted):
            sequence = event.sequence
            self.settle(lambda a: isinstance(a, do.NotifyAcknowledged) and a.sequence == sequence)
            event = ev.Tick(self.at())
        event = replace(event, at=self.at())
        match event:
            case ev.BeginAnswered(number=number):
                self.settle(lambda a: isinstance(a, do.RequestBegin) and a.number == number)
            case ev.OpenAnswered(number=number):
                self.settle(lambda a: isinstance(a, do.RequestOpen) and a.number == number)
            case ev.OutcomeReceived(outcome=received):
                self.settle(lambda a: isinstance(a, do.RequestOutcome) and a.sequence == received.sequence)
            case ev.CommandAnswered(number=number):
                self.settle(lambda a: isinstance(a, do.RequestCommand) and a.number == number)
            case ev.OutcomeNoted(sequence=sequence):
                self.settle(lambda a: isinstance(a, do.NotifyPublished) and a.outcome.sequence == sequence)
        self.feed(event)
        self.send_next_note()

    def settle(self, is_it: Any) -> None:
        self.pending = [request for request in self.pending if not is_it(request.action)]

    # the station's process

    def serve(self, request: Request) -> None:
        station, at = self.station, self.at()
        if not station.up or request.expires_s < self.now_s:
            return
        match request.action:
            case do.RequestBegin(number=number, trigger_id=trigger_id):
                self.answers.append(ev.BeginAnswered(at, number, station.begin(trigger_id)))
            case do.RequestOutcome(sequence=sequence):
                station.waiting.add(sequence)
                self.send_outcomes()
            case do.RequestCommand(number=number, argument=argument):
                self.answers.append(ev.CommandAnswered(at, number, done=argument % 2 == 0, why="no"))
            case do.RequestOpen(number=number):
                self.answers.append(ev.OpenAnswered(at, number, station.open()))
            case do.NotifyPublished(outcome=published):
                station.publish(published)
                self.answers.append(ev.OutcomeNoted(at, published.sequence))
            case do.NotifyAcknowledged(sequence=sequence):
                for number, record in station.records.items():
                    record.acknowledged |= number <= sequence
                self.answers.append(AcknowledgementNoted(at, sequence))

    def send_outcomes(self) -> None:
        for sequence in sorted(self.station.waiting):
            record = self.station.records[sequence]
            if record.judged is not None or record.published is not None:
                standing = record.judged or record.published
                assert standing is not None
                self.station.waiting.discard(sequence)
                self.answers.append(ev.OutcomeReceived(self.at(), standing))

    # what the PLC sees

    def bit(self, name: str) -> bool:
        value = self.seen["status"]
        assert isinstance(value, int)
        return bool(value & STATUS.flags([name]))

    def observe(self) -> None:
        seen = self.seen
        accepted = seen["accepted_trigger_id"]
        assert isinstance(accepted, int)
        if accepted:
            self.accepted.add(accepted)
            self.refused.discard(accepted)  # a PLC may give a refused trigger again
        missed = (seen["interface_boots"], seen["counters_epoch"], seen["count_missed"])
        if missed != self.missed and self.bit("missed"):
            self.missed = missed
            if seen["last_refusal"] != BY_NAME["last_refusal"].code("bad_trigger_id"):
                refused = seen["last_refused_trigger_id"]
                lost = seen["last_refusal"] == BY_NAME["last_refusal"].code("station_lost")
                if not (lost and refused in self.triggered_again):
                    assert refused not in self.accepted, "a trigger that was accepted is reported as refused"
                    self.refused.add(refused)
        if not self.bit("result_valid"):
            assert seen["result_sequence"] == seen["result_outcome"] == 0
            return
        block = {name: value for name, value in seen.items() if name.startswith("result_")}
        block.pop("result_deadline_ms", None)
        sequence = block["result_sequence"]
        assert isinstance(sequence, int)
        assert sequence == block["result_sequence_again"]
        assert sequence not in self.taken, "shown again after it was acknowledged"
        assert all(sequence > taken for taken in self.taken), "shown after a later one was acknowledged"
        assert self.shown.setdefault(sequence, block) == block, "two outcomes under one sequence"
        record = self.station.records[sequence]
        assert block["result_trigger_id"] == record.trigger_id, "a wrong id"
        assert record.trigger_id not in self.refused, "a result of a trigger that was refused"
        flags = block["result_flags"]
        assert isinstance(flags, int)
        if block["result_outcome"] != BY_NAME["result_outcome"].code("NO_RESULT"):
            assert record.judged is not None
            assert block["result_outcome"] == BY_NAME["result_outcome"].code(record.judged.outcome)
        if flags & BY_NAME["result_flags"].flags(["area_valid"]):
            assert record.judged is not None
            assert block["result_area_mm2"] == record.judged.area_mm2

    # the PLC's rules

    def write(self, **values: Any) -> None:
        """One write of the PLC, and what it reads back."""
        written = set(values)
        if "control" in values:
            self.control = set(values["control"])
            values["control"] = frozenset(self.control)
        if not self.state.writer:
            self.feed(ev.WriterGranted(self.at()))
        self.inputs = replace(self.inputs, **values)
        shown = self.seen["result_sequence"]
        run = self.runs
        self.feed(ev.PlcWrote(self.at(), self.inputs, frozenset(written)))
        same_run = self.runs == run
        if same_run and shown and values.get("acknowledged_sequence") == shown != self.seen["result_sequence"]:
            assert isinstance(shown, int)
            self.taken.add(shown)

    @rule(on=st.booleans())
    def enable(self, on: bool) -> None:
        self.write(control=self.control | {"enable"} if on else self.control - {"enable"})

    @rule(on=st.booleans())
    def buffer(self, on: bool) -> None:
        self.write(control=self.control | {"buffer_results"} if on else self.control - {"buffer_results"})

    @rule(lot=st.sampled_from(["", "lot 7"]))
    def rearm(self, lot: str) -> None:
        self.write(control=set())
        self.write(control={"enable", "buffer_results"}, lot=lot)

    @rule(armed=st.sampled_from([True, True, True, False]), link=st.booleans())
    def trigger(self, armed: bool, link: bool) -> None:
        """With a new id; mostly a PLC that arms first, and often with a station that is there."""
        if link and self.state.link is not Link.UP:
            self.heal()
        if armed and self.state.arming is not Arming.ARMED:
            self.rearm("")
        self.write(control=self.control - {"trigger"})
        trigger_id, self.next_id = self.next_id, self.next_id + 1
        self.write(control=self.control | {"trigger"}, trigger_id=trigger_id)

    @rule()
    def trigger_again_with_the_same_id(self) -> None:
        self.write(control=self.control - {"trigger"})
        trigger_id = self.seen["accepted_trigger_id"]
        self.triggered_again.add(trigger_id)
        self.write(control=self.control | {"trigger"}, trigger_id=trigger_id)

    @rule()
    def drop_trigger(self) -> None:
        self.write(control=self.control - {"trigger"})

    @rule()
    def acknowledge_by_sequence_and_then_by_bit(self) -> None:
        run = self.runs
        if self.bit("result_valid") and "acknowledge" not in self.control:
            self.write(acknowledged_sequence=self.seen["result_sequence"])
            self.write(control=self.control | {"acknowledge"})
            self.falls_for_the_bit(run)

    def falls_for_the_bit(self, run: int) -> None:
        """A PLC that waits for result_valid to fall after its bit is not let down."""
        if self.runs == run and not self.state.acknowledge_stuck:
            assert not self.bit("result_valid")

    @rule(by_bit=st.booleans())
    def acknowledge(self, by_bit: bool) -> None:
        sequence, run = self.seen["result_sequence"], self.runs
        if not self.bit("result_valid"):
            return
        if by_bit:
            self.write(control=self.control | {"acknowledge"}, acknowledged_sequence=sequence)
            self.falls_for_the_bit(run)
        else:
            self.write(acknowledged_sequence=sequence)

    def may_have_been_taken(self, sequence: int) -> bool:
        """Of what a start finds open only the PLC's first write shows if it was taken before: that is believed.

        A loss of power may have taken the outcome from the journal, or the acknowledgement.
        """
        running = {self.state.running.sequence} if self.state.running else set()
        return self.state.result is Result.WITHHELD and sequence in running | {one.sequence for one in self.state.queue}

    @rule(sequence=st.integers(0, 140))
    def acknowledge_nonsense(self, sequence: int) -> None:
        if sequence != self.seen["result_sequence"] and not self.may_have_been_taken(sequence):
            self.write(control=self.control | {"acknowledge"}, acknowledged_sequence=sequence)

    @rule(by_bit=st.booleans())
    def acknowledge_early(self, by_bit: bool) -> None:
        """The number of the inspection that runs, or of the next one, before there is an outcome."""
        running = self.state.running
        sequence = running.sequence if running else self.state.journal.highest + 1
        if sequence != self.seen["result_sequence"] and not self.may_have_been_taken(sequence):
            control = self.control | {"acknowledge"} if by_bit else self.control
            self.write(control=control, acknowledged_sequence=sequence)

    @rule()
    def drop_acknowledge(self) -> None:
        self.write(control=self.control - {"acknowledge"})

    @rule()
    def beat_of_the_plc(self) -> None:
        self.write(plc_heartbeat=(self.inputs.plc_heartbeat + 1) % 2**16)

    @rule(code=st.integers(0, 5), argument=st.integers(0, 1), repeated=st.booleans())
    def command(self, code: int, argument: int, repeated: bool) -> None:
        self.write(control=self.control - {"execute_command"})
        sequence = (self.inputs.command_sequence + (not repeated)) % 2**16
        self.write(
            control=self.control | {"execute_command"},
            command_code=code,
            command_argument=argument,
            command_sequence=sequence,
        )

    @rule(what=st.sampled_from(["command", "lot", "acknowledgement", "trigger"]), argument=st.integers(0, 1))
    def left_high(self, what: str, argument: int) -> None:
        """A bit that the PLC forgets, until the interface has given it up."""
        match what:
            case "command":
                self.command(code=1, argument=argument, repeated=False)
            case "lot":
                self.short_order("latch_lot", "a")
            case "acknowledgement":
                self.whole_cycle()
                self.station_judges("FAIL")
                self.everything_arrives()
                self.acknowledge(by_bit=True)
            case "trigger":
                self.whole_cycle()
        self.everything_arrives()
        self.time_passes(5.5, beats=True)

    @rule(
        name=st.sampled_from(["clear_error", "reset_counters", "offline", "latch_lot"]),
        lot=st.sampled_from(["a", None]),
    )
    def short_order(self, name: str, lot: str | None) -> None:
        """A bit that the interface carries out by itself: given, seen, mostly taken back."""
        run = self.runs
        self.write(control=self.control - {name})
        epoch = self.state.journal.epoch
        self.write(control=self.control | {name}, lot=lot)
        if self.runs != run:
            return
        match name:
            case "clear_error":
                assert not any(map(self.bit, ("missed", "overrun")))
                assert (self.seen["last_refusal"], self.state.faults) == (0, ())
            case "reset_counters":
                assert {self.seen[counter] for counter in HANDSHAKE_COUNTERS} == {0}
                assert self.seen["counters_epoch"] == (epoch + 1) % 2**32
            case "offline":
                assert not any(map(self.bit, ("online", "trigger_ready")))
                self.write(control=self.control - {name})
                if self.runs == run:
                    assert self.bit("online") == (self.state.link is Link.UP)
            case "latch_lot":
                assert self.bit("lot_latched") == (lot is not None)
                assert (Fault.BAD_LOT in self.state.faults) or lot is not None
                assert lot is None or self.seen["latched_lot_checksum"] == lot_checksum(lot)

    @rule()
    def drop_latch(self) -> None:
        run = self.runs
        self.write(control=self.control - {"latch_lot"})
        assert not self.bit("lot_latched") or self.runs != run

    @rule()
    def drop_execute(self) -> None:
        self.write(control=self.control - {"execute_command"})

    @rule()
    def writer_goes(self) -> None:
        self.feed(ev.WriterWithdrawn(self.at()))

    @rule()
    def reconnect(self) -> None:
        self.feed(ev.WriterWithdrawn(self.at()))
        self.feed(ev.WriterGranted(self.at()))

    # the wire's rules

    @precondition(lambda self: self.to_station)
    @rule(data=st.data(), doubled=st.sampled_from([False, False, False, True]))
    def request_arrives(self, data: Any, doubled: bool) -> None:
        request = data.draw(st.sampled_from(self.to_station))
        if not doubled:
            self.to_station.remove(request)
        self.serve(request)

    @precondition(lambda self: self.answers)
    @rule(data=st.data(), doubled=st.sampled_from([False, False, False, True]))
    def answer_arrives(self, data: Any, doubled: bool) -> None:
        event = data.draw(st.sampled_from(self.answers))
        if not doubled:
            self.answers.remove(event)
        self.deliver(event)

    @precondition(lambda self: self.to_station or self.answers)
    @rule(data=st.data())
    def message_is_lost(self, data: Any) -> None:
        queue = data.draw(st.sampled_from([queue for queue in (self.to_station, self.answers) if queue]))
        queue.remove(data.draw(st.sampled_from(queue)))

    @rule()
    def everything_arrives(self) -> None:
        for _ in range(30):
            while self.to_station:
                self.serve(self.to_station.pop(0))
            if not self.answers:
                return
            self.deliver(self.answers.pop(0))

    @rule(name=st.sampled_from(["PASS", "FAIL"]))
    def station_judges(self, name: str) -> None:
        if self.station.up and self.station.running is not None:
            self.station.judge(name)
            self.send_outcomes()

    @rule()
    def jaws_open(self) -> None:
        self.station.jaws_closed = self.station.running is not None

    @rule(passed_s=st.sampled_from([0.01, 0.1, 0.45, 0.9, 1.1, 4.4, 5.5]), beats=st.booleans())
    def time_passes(self, passed_s: float, beats: bool) -> None:
        end_s = self.now_s + passed_s
        while self.now_s < end_s:
            self.now_s = min(end_s, self.now_s + 0.5)
            if beats and self.station.up:
                self.feed(ev.Beat(self.at(), self.station.state(), self.now_s))
            self.feed(ev.Tick(self.at()))
            for request in [request for request in self.pending if request.expires_s <= self.now_s]:
                if request in self.pending:
                    self.pending.remove(request)
                    self.failed(request)
                    self.send_next_note()

    @rule()
    def beat(self) -> None:
        if self.station.up:
            self.feed(ev.Beat(self.at(), self.station.state(), self.now_s))

    @rule(ready=st.booleans())
    def output_changed(self, ready: bool) -> None:
        self.feed(ev.OutputChanged(self.at(), ready))

    @rule()
    def whole_cycle(self) -> None:
        """A good moment, so that what follows starts somewhere interesting."""
        self.heal()
        self.trigger(armed=True, link=True)
        self.everything_arrives()

    @rule(restarted=st.booleans())
    def station_dies_over_a_fruit_and_then_the_interface(self, restarted: bool) -> None:
        self.whole_cycle()
        self.station_dies()
        self.time_passes(1.1, beats=False)
        if restarted:
            self.station_restarts()
        self.interface_restarts()

    @rule(passed_s=st.sampled_from([0.0, 0.45, 1.1]), interface=st.booleans())
    def begin_reply_is_lost(self, passed_s: float, interface: bool) -> None:
        """The station has accepted a trigger; its answer never comes."""
        self.heal()
        self.trigger(armed=True, link=True)
        while self.to_station:
            self.serve(self.to_station.pop(0))
        self.answers.clear()
        self.time_passes(passed_s, beats=True)
        if interface:
            self.interface_restarts()

    @rule()
    def begins_late(self) -> None:
        """The station carries out a trigger whose answer is not waited for any more, after it reported idle."""
        self.heal()
        self.trigger(armed=True, link=True)
        late = [request for request in self.to_station if isinstance(request.action, do.RequestBegin)]
        self.to_station = [request for request in self.to_station if request not in late]
        self.time_passes(SETTINGS.begin_deadline_s, beats=True)
        self.heal()
        run = self.runs
        for request in late:
            reply = self.station.begin(request.action.trigger_id)
            self.answers.append(ev.BeginAnswered(self.at(), request.action.number, reply))
        self.heal()
        assert not late or self.runs != run or self.station.running is None, "a refused fruit is inspected"

    @precondition(lambda self: self.station.up)
    @rule()
    def station_dies(self) -> None:
        self.station.up = False
        self.answers.clear()
        self.to_station.clear()

    @rule()
    def station_restarts(self) -> None:
        self.answers.clear()
        self.station.restart()

    @rule(after=st.integers(0, 6))
    def interface_dies_in_its_next_step(self, after: int) -> None:
        self.crash_after = after

    @rule()
    def interface_restarts(self) -> None:
        self.crash_after = None
        self.boot()

    @invariant()
    def every_pair_that_came_is_in_the_table(self) -> None:
        assert self.state.unlisted == 0
        assert self.state.timers.keys() <= {*self.state.timers}
        assert len(self.state.queue) <= 9

    def heal(self) -> None:
        """The station answers, the wire works, and time passes until the link is up."""
        if not self.station.up:
            self.station.restart()
        self.output_changed(ready=True)
        for _ in range(200):
            self.time_passes(0.1, beats=True)
            self.everything_arrives()
            if self.state.link is Link.UP and not self.has_pending_notes():
                return
        raise AssertionError("the interface and the station do not settle")

    def has_pending_notes(self) -> bool:
        return bool(self.notes or self.state.journal.verdicts)

    def teardown(self) -> None:
        """In the end everything that was accepted has been shown once, and the station knows what was shown."""
        if not hasattr(self, "commands"):
            return
        self.crash_after = None
        self.heal()
        if self.state.running is not None:
            self.station_judges("PASS")
            self.everything_arrives()
        self.time_passes(5.5, beats=True)
        self.heal()
        for _ in range(12):
            self.write(control=self.control - {"acknowledge", "trigger"})
            self.acknowledge(by_bit=False)
            self.heal()
        assert not self.bit("result_valid")
        assert self.state.unlisted == 0
        assert self.state.queue == self.state.journal.verdicts == self.state.journal.hidden == ()
        shown_ids = [block["result_trigger_id"] for block in self.shown.values()]
        assert sorted(shown_ids) == sorted(self.accepted)
        for sequence, block in self.shown.items():
            record = self.station.records[sequence]
            assert record.acknowledged
            assert record.standing is not None
            assert block["result_outcome"] == BY_NAME["result_outcome"].code(record.standing.outcome)
        assert all(record.acknowledged for record in self.station.records.values())
        self.jaws_open()
        self.beat()
        assert not self.bit("acquiring")
        self.whole_cycle()
        assert self.seen["accepted_trigger_id"] == self.next_id - 1, f"the interface is blocked: {self.state}"


def test_a_number_that_the_plc_had_before_the_fruit_does_not_take_its_outcome(station_model, laws):
    """The PLC's first write after a start acknowledges an inspection that begins only after it."""
    play = Handshake(station_model, laws)
    play.start()
    play.acknowledge_nonsense(sequence=101)
    play.interface_restarts()
    play.whole_cycle()
    play.station_dies()
    play.time_passes(1.1, beats=False)
    play.teardown()
    assert 101 in play.shown


def test_a_trigger_left_high_with_an_accepted_id_may_be_refused_after_a_start(station_model, laws):
    play = Handshake(station_model, laws)
    play.start()
    play.station_dies_over_a_fruit_and_then_the_interface(restarted=False)
    play.trigger(armed=True, link=True)
    play.trigger_again_with_the_same_id()
    play.interface_dies_in_its_next_step(after=3)
    play.left_high(argument=0, what="command")
    play.acknowledge_nonsense(sequence=1)
    play.teardown()


def test_the_handshake_keeps_its_promises_whatever_comes(station_model, laws):
    run_state_machine_as_test(
        lambda: Handshake(station_model, laws),  # pyrefly: ignore[bad-argument-type] (Hypothesis calls it)
        settings=settings(
            max_examples=settings().max_examples * 4 // 5,
            stateful_step_count=40,
            suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large],
        ),
    )
