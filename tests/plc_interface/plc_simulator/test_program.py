"""The PLC's program against a station that is played by hand, register by register."""

import math
import zlib
from typing import Any

import pytest

from plc_interface.plc_simulator.faults import FaultPlan, LineFault
from plc_interface.plc_simulator.program import (
    ANSWER_LIMIT_S,
    HEARTBEAT_LIMIT_S,
    Decision,
    LineProgram,
    Stage,
)
from plc_interface.registers.map import BY_NAME, MORE_STATUS, RESULT, STATUS

SCAN_S = 0.1


class Station:
    """Answers as the interface does, one scan behind, and makes the mistake that a test sets."""

    def __init__(self, outcome="PASS"):
        self.outcome, self.next_sequence, self.heartbeat = outcome, 40, 0
        self.values: dict[str, Any] = {register.name: 0 for register in (*STATUS, *RESULT, *MORE_STATUS)}
        self.values |= {"result_area_mm2": math.nan, "active_recipe": 1, "result_deadline_ms": 5000}
        self.bits = {"online", "trigger_ready"}
        self.results, self.up, self.accepted = [], frozenset(), []
        self.alive, self.refuses, self.answers, self.acknowledged = True, "", True, []
        self.measures, self.length, self.called_off = True, 0, 0

    def scan(self, outputs):
        up = BY_NAME["control"].names(outputs["control"])
        self.bits.add("writer_owned")
        rising = up - self.up
        self.up = up
        if "latch_lot" in up:
            self.values["latched_lot_checksum"] = zlib.crc32(outputs["lot"].encode())
        if "execute_command" in rising:
            self.values["active_recipe"] = outputs["command_argument"]
            self.bits.add("trigger_ready")
            self.values["command_sequence_echo"] = outputs["command_sequence"]
            self.values["command_result"] = BY_NAME["command_result"].code("done")
        if "trigger" in rising and self.answers:
            self.answer(outputs["trigger_id"], outputs["fruit_length_mm_x10"])
        if "trigger" not in up:
            self.bits.discard("trigger_acknowledged")
        if outputs["acknowledged_sequence"] == self.values["result_sequence"] != 0:
            self.acknowledged.append(outputs["acknowledged_sequence"])
            self.values["acknowledged_sequence_echo"] = outputs["acknowledged_sequence"] + self.called_off
            self.show(0, 0)
        if self.measures and self.results and not self.values["result_sequence"]:
            self.show(*self.results.pop(0))
        self.heartbeat += self.alive
        self.values["station_heartbeat"] = self.heartbeat
        self.values["status"] = BY_NAME["status"].flags(self.bits)
        return dict(self.values)

    def answer(self, trigger_id, length):
        self.length = length
        self.bits |= {"trigger_acknowledged"}
        if self.refuses or trigger_id == self.values["accepted_trigger_id"]:
            self.values["last_refused_trigger_id"] = trigger_id
            self.values["last_refusal"] = BY_NAME["last_refusal"].code(self.refuses or "bad_trigger_id")
            self.bits.add("missed")
            return
        self.bits.discard("missed")
        self.values["accepted_trigger_id"] = trigger_id
        self.accepted.append(trigger_id)
        self.next_sequence += 1
        self.results.append((self.next_sequence, trigger_id))

    def show(self, sequence, trigger_id):
        copies = ("result_sequence", "result_sequence_again", "result_sequence_end")
        self.values |= dict.fromkeys(copies, sequence)
        self.values["result_fruit_length_mm_x10"] = self.length if sequence else 0
        self.values["result_trigger_id"] = trigger_id
        self.values["result_outcome"] = BY_NAME["result_outcome"].code(self.outcome if sequence else "none")
        self.values["result_area_mm2"] = 12.5 if sequence else math.nan
        (self.bits.add if sequence else self.bits.discard)("result_valid")


class Line:
    def __init__(self, station, *faults, lot=""):
        self.station, self.program = station, LineProgram(FaultPlan(faults, every=1), lot)
        self.now_s, self.fruit, self.passages, self.cuts = 0.0, False, [], 0
        self.inputs: Any = None
        self.recipe, self.length, self.connected = 0, 0, True
        self.outputs: dict[str, Any] = {}

    def scan(self):
        self.now_s += SCAN_S
        self.outputs = self.program.scan(
            self.inputs, self.now_s, fruit_in_nest=self.fruit, recipe=self.recipe, fruit_length_mm_x10=self.length
        )
        self.cuts += self.program.cut_wanted
        self.inputs = self.station.scan(self.outputs) if self.connected else None
        decided = self.program.take_passages()
        self.passages += decided
        self.fruit = self.fruit and not decided

    def until(self, condition, limit_s=60.0):
        end_s = self.now_s + limit_s
        while not condition():
            assert self.now_s < end_s, f"still {self.program.stage} after {limit_s} s"
            self.scan()

    def inspect(self):
        self.until(lambda: self.program.free)
        self.fruit, before = True, len(self.passages)
        self.until(lambda: len(self.passages) > before)
        return self.passages[-1]

    @property
    def bits(self):
        return BY_NAME["control"].names(self.outputs["control"])


@pytest.mark.parametrize("outcome", ["PASS", "FAIL", "NO_RESULT"])
def test_a_fruit_is_decided_by_its_own_result_which_is_acknowledged(outcome):
    line = Line(Station(outcome))
    first, second = line.inspect(), line.inspect()
    line.until(lambda: line.program.free)
    assert [first.decision, second.decision] == [Decision(outcome)] * 2
    assert [passage.trigger_id for passage in (first, second)] == line.station.accepted == [1, 2]
    assert line.station.acknowledged == [first.sequence, second.sequence] == [41, 42]
    assert first.area_mm2 == 12.5
    assert first.diverted == (outcome != "PASS")


def test_trigger_ids_go_on_from_the_stations_last_and_never_become_0():
    station = Station()
    station.values["accepted_trigger_id"] = 65_534
    line = Line(station)
    assert [line.inspect().trigger_id for _ in range(3)] == [65_535, 1, 2]


def test_results_of_an_earlier_run_are_taken_away_and_decide_nothing():
    station = Station()
    station.results = [(7, 1), (8, 900)]
    line = Line(station)
    station.values["accepted_trigger_id"] = 900
    assert line.inspect().sequence == 41
    assert line.program.counters.stale == 2
    assert station.acknowledged[:2] == [7, 8]


def test_a_result_is_acknowledged_also_where_an_inspection_behind_it_was_called_off():
    station = Station()
    station.called_off = 1
    line = Line(station)
    assert line.inspect().decision is Decision.PASS
    line.until(lambda: line.program.free)


@pytest.mark.parametrize("copy", ["result_sequence_again", "result_sequence_end"])
def test_a_result_with_two_different_sequences_is_torn_and_not_used(copy):
    station = Station()
    line = Line(station)
    line.until(lambda: line.program.free)
    line.fruit = True
    line.until(lambda: station.values["result_sequence"] == 41)
    line.inputs = line.inputs | {copy: 40}
    line.scan()
    assert line.passages == []
    line.until(lambda: line.passages)
    assert line.passages[0].sequence == 41


def test_the_size_is_sent_with_its_own_fruit_alone_and_read_back_with_the_result():
    line = Line(Station())
    line.length = 483
    assert line.inspect().fruit_length_mm_x10 == 483
    assert line.outputs["fruit_length_mm_x10"] == 0, "it would be the next fruit's"
    line.length = 0
    assert line.inspect().fruit_length_mm_x10 == 0


def test_a_refused_fruit_is_diverted_with_the_reason_and_the_next_one_is_tried():
    station = Station()
    station.refuses = "not_ready"
    line = Line(station)
    refused = line.inspect()
    assert (refused.decision, refused.reasons, refused.diverted) == (Decision.REFUSED, ("not_ready",), True)
    station.refuses = ""
    assert line.inspect().decision is Decision.PASS


def test_a_trigger_without_an_answer_is_given_up():
    station = Station()
    station.answers = False
    line = Line(station)
    passage = line.inspect()
    assert passage.decision is Decision.NO_ANSWER
    assert passage.cycle_s == pytest.approx(ANSWER_LIMIT_S, abs=1.0)


@pytest.mark.parametrize("way", ["heartbeat", "connection", "online", "writer"])
def test_a_lost_station_disarms_the_line_and_the_fruit_keeps_its_right_to_its_own_result(way):
    station = Station()
    line = Line(station)
    line.until(lambda: line.program.free)
    line.fruit = True
    station.measures = False
    line.until(lambda: line.program.stage is Stage.WAITING_FOR_RESULT)
    station.alive, line.connected = way != "heartbeat", way != "connection"
    station.bits.discard("online" if way == "online" else "")
    bits, station.bits = station.bits, station.bits - {"writer_owned"} if way == "writer" else station.bits
    if way == "writer":
        line.inputs = line.inputs | {"status": BY_NAME["status"].flags(station.bits)}
    line.until(lambda: line.program.stage is Stage.CLAIMING, HEARTBEAT_LIMIT_S + 1)
    assert not line.bits & {"enable", "trigger", "acknowledge"}
    assert line.program.counters.losses == 1
    station.alive = line.connected = True
    station.bits = bits | {"online"}
    station.measures = True
    line.until(lambda: line.passages)
    assert (line.passages[0].decision, line.passages[0].trigger_id) == (Decision.PASS, 1)


def test_a_fruit_whose_station_never_comes_back_is_diverted():
    station = Station()
    line = Line(station)
    line.until(lambda: line.program.free)
    line.fruit, station.measures = True, False
    line.until(lambda: line.program.stage is Stage.WAITING_FOR_RESULT)
    line.connected = False
    line.until(lambda: line.passages)
    assert line.passages[0].decision is Decision.NO_ANSWER
    line.connected = station.measures = True
    assert line.inspect().trigger_id == 2
    assert line.program.counters.stale == 1


def test_the_lot_is_latched_before_the_first_fruit():
    line = Line(Station(), lot="GROWER-7")
    line.inspect()
    assert line.station.values["latched_lot_checksum"] == zlib.crc32(b"GROWER-7")
    assert "latch_lot" not in line.bits


@pytest.mark.parametrize("active", [0, 1])
def test_the_recipe_is_changed_where_the_fruit_needs_another_one(active):
    line = Line(Station())
    line.station.values["active_recipe"] = active
    line.station.bits -= set() if active else {"trigger_ready"}
    line.recipe = 3
    assert line.inspect().decision is Decision.PASS
    assert line.station.values["active_recipe"] == 3
    assert "execute_command" not in line.bits


@pytest.mark.parametrize("fault", LineFault)
def test_every_fault_is_played_and_every_fruit_is_still_decided_once(fault):
    station = Station()
    line = Line(station, fault)
    passages = [line.inspect() for _ in range(3)]
    line.until(lambda: line.program.free)
    assert [passage.fault for passage in passages] == [fault] * 3
    decisions = [passage.decision for passage in passages]
    if fault is LineFault.REPEATED_ID:
        assert decisions[1:] == [Decision.REFUSED] * 2
        return
    assert decisions == [Decision.PASS] * 3
    assert len(set(station.acknowledged)) == 3
    assert line.program.counters.doubled == 0
    if fault is LineFault.SKIPPED_ID:
        assert station.accepted == [3, 6, 9]
    assert line.cuts == (3 if fault is LineFault.RECONNECT else 0)


def test_a_fruit_stays_where_the_station_is_lost_before_its_arm_has_left():
    station = Station()
    station.bits.add("acquiring")
    line = Line(station)
    assert line.inspect().decision is Decision.PASS
    assert not line.program.may_move
    station.bits = {"writer_owned", "acquiring", "error"}
    station.values["active_recipe"] = 0
    for _ in range(3):
        line.scan()
        assert not line.program.may_move


def test_enable_falls_while_the_station_inhibits_it_and_rises_again():
    station = Station()
    line = Line(station)
    line.until(lambda: line.program.free)
    line.scan()
    assert "enable" in line.bits
    station.values["more_status"] = BY_NAME["more_status"].flags(["enable_inhibited"])
    line.scan()
    line.scan()
    assert "enable" not in line.bits
    station.values["more_status"] = 0
    line.scan()
    line.scan()
    assert "enable" in line.bits
    assert line.program.counters.losses == 0
