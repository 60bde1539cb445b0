"""The function block, run by an evaluator against a station that does what the test sets."""

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.codec import WordOrder
from plc_interface.registers.map import BY_NAME

OUTPUTS = (
    "alive", "ready", "busy", "done", "passed", "may_move", "refused", "refusal", "timed_out", "result", "status",
    "recipe_busy", "recipe_done", "recipe_failed",
)  # fmt: skip


def zero(value):
    return not any(map(zero_not, value.values())) if isinstance(value, dict) else not value


def zero_not(value):
    return not zero(value)


@pytest.mark.parametrize("order", WordOrder)
def test_an_inspection_from_trigger_to_acknowledgement(make_plc, order):
    plc = make_plc(order)
    plc.accepted()
    assert plc.written("encoder") == 0x00ABCDEF
    assert (plc.block["busy"], plc.block["done"]) == (True, False)
    plc.station.show(
        0x00010002, 7, result_area_mm2_x100=1234, result_area_px=70_000, result_closing_mm_x100=-5,
        result_ended_utc_ms=0x0000_0123_4567_89AB, result_encoder=0x00ABCDEF,
        result_fruit_length_mm_x10=483, result_size_class=3,
    )  # fmt: skip
    plc.scan()
    block = plc.block
    assert (block["done"], block["passed"], block["busy"], block["refused"], block["timed_out"]) == (
        True, True, False, False, False,
    )  # fmt: skip
    result = block["result"]
    assert (result["sequence"], result["trigger_id"], result["outcome"]) == (0x00010002, 7, 1)
    assert (result["area_mm2_x100"], result["area_px"], result["closing_mm_x100"]) == (1234, 70_000, -5)
    assert (result["ended_utc_ms_high"], result["ended_utc_ms_low"]) == (0x0123, 0x456789AB)
    assert (result["encoder"], result["fruit_length_mm_x10"], result["size_class"]) == (0x00ABCDEF, 483, 3)
    assert plc.control() == {"enable", "acknowledge"}
    assert plc.written("acknowledged_sequence") == 0x00010002
    plc.station.flags("online", "trigger_ready")
    plc.scan()
    assert plc.control() == {"enable"}
    assert block["passed"]
    plc.scan(inspect=False)
    assert not block["done"]
    assert not block["passed"]
    assert zero(block["result"])
    plc.scan()
    assert block["ready"]


def test_reasons_and_flags_have_their_names(plc):
    plc.accepted()
    reasons = BY_NAME["result_reasons"].flags(["area_over_limit", "early_stop", "internal_fault"])
    plc.station.show(5, 7, "FAIL", result_reasons=reasons)
    plc.scan()
    result = plc.block["result"]
    assert {name for name, value in result.items() if value is True} == {
        "reason_area_over_limit", "reason_early_stop", "reason_internal_fault",
    }  # fmt: skip
    assert (plc.block["done"], plc.block["passed"]) == (True, False)


@pytest.mark.parametrize(
    ("outcome", "flags"),
    [
        ("FAIL", ["area_valid"]),
        ("NO_RESULT", []),
        ("NO_RESULT", ["pass", "area_valid"]),
        ("PASS", ["area_valid"]),
        ("PASS", ["pass"]),
        ("PASS", ["pass", "area_valid", "late"]),
        ("PASS", ["pass", "area_valid", "simulated"]),
    ],
)
def test_what_is_not_surely_good_does_not_pass(plc, outcome, flags):
    plc.accepted()
    plc.station.show(5, 7, outcome, result_flags=BY_NAME["result_flags"].flags(flags))
    plc.scan()
    assert plc.block["done"]
    assert not plc.block["passed"]


def test_a_simulated_result_passes_only_where_it_may(plc):
    plc.accepted()
    flags = BY_NAME["result_flags"].flags(["pass", "area_valid", "simulated"])
    plc.station.show(5, 7, result_flags=flags)
    plc.scan(accept_simulated=True)
    assert plc.block["passed"]


def test_a_fruit_may_be_moved_once_the_arm_has_left_which_is_after_its_result(plc):
    plc.scan(3)
    assert plc.block["may_move"]
    plc.accepted()
    assert not plc.block["may_move"], "acquiring may come a scan later"
    plc.station.show(5, 7)
    plc.station.flags("online", "result_valid", "acquiring")
    plc.scan()
    assert (plc.block["done"], plc.block["passed"], plc.block["may_move"]) == (True, True, False)
    plc.station.flags("online", "trigger_ready", "acquiring")
    plc.scan(5)
    assert not plc.block["may_move"]
    plc.station.flags("online", "trigger_ready")
    plc.scan(connected=False)
    assert not plc.block["may_move"]
    plc.scan(connected=True)
    assert (plc.block["done"], plc.block["passed"], plc.block["may_move"]) == (True, True, True)
    plc.scan(inspect=False)
    assert plc.block["may_move"]


@pytest.mark.parametrize("mode", ["maintenance", "manual"])
def test_no_fruit_may_be_moved_while_a_person_moves_jaws_and_arm(plc, mode):
    plc.station.set(packml_mode=BY_NAME["packml_mode"].code(mode))
    plc.scan(3)
    assert not plc.block["may_move"]
    plc.station.set(packml_mode=BY_NAME["packml_mode"].code("production"))
    plc.scan(2)
    assert plc.block["may_move"]


@pytest.mark.parametrize("bits", [("online", "trigger_ready"), ("online", "acquiring")])
def test_without_the_station_no_fruit_may_be_moved(plc, bits):
    plc.station.flags(*bits)
    plc.scan(3)
    assert plc.block["may_move"] == ("acquiring" not in bits)
    plc.station.beating = False
    plc.scan(210)
    assert not plc.block["alive"]
    assert not plc.block["may_move"]
    plc.scan(5, connected=False)
    assert not plc.block["may_move"]


@pytest.mark.parametrize("when", ["before the answer", "before the result", "with the result"])
@pytest.mark.parametrize("for_scans", [1, 30])
def test_a_fruit_laid_in_the_place_of_one_taken_away_does_not_pass_on_its_result(plc, when, for_scans):
    if when == "before the answer":
        plc.scan(3)
        plc.scan(inspect=True)
        plc.scan(for_scans, inspect=False)
        plc.scan(inspect=True)
        plc.station.set(accepted_trigger_id=7)
        plc.station.flags("online", "trigger_acknowledged", "inspecting")
        plc.scan()
    else:
        plc.accepted()
    if when == "before the result":
        plc.scan(for_scans, inspect=False)
        plc.scan(inspect=True, fruit_id=8)
    plc.station.show(5, 7)
    if when == "with the result":
        plc.scan(inspect=False)
        assert not plc.block["passed"]
    plc.scan(inspect=True)
    assert (plc.block["done"], plc.block["passed"]) == (True, False)
    plc.station.flags("online", "trigger_ready")
    plc.scan(inspect=False)
    plc.accepted(fruit_id=9)
    plc.station.show(6, 9)
    plc.scan()
    assert plc.block["passed"], "the next fruit, which stayed"


@pytest.mark.parametrize("phase", ["idle", "triggered", "accepted", "ended", "changing recipe"])
def test_every_output_is_zero_once_the_stations_heartbeat_stops(plc, phase):
    match phase:
        case "idle":
            plc.scan(3)
        case "triggered":
            plc.scan(3)
            plc.scan(inspect=True)
        case "accepted":
            plc.accepted()
        case "ended":
            plc.accepted()
            plc.station.show(5, 7)
            plc.scan()
            assert plc.block["passed"]
        case _:
            plc.scan(3)
            plc.scan(change_recipe=True)
            assert plc.block["recipe_busy"]
    assert plc.block["alive"]
    plc.station.beating = False
    plc.wait(2.1)
    assert [name for name in OUTPUTS if not zero(plc.block[name])] == []
    assert plc.control() == frozenset()
    left = {at for at, word in enumerate(plc.block["registers"]) if word}
    assert left <= {BY_NAME["plc_heartbeat"].address, BY_NAME["write_key"].address}
    assert plc.written("write_key") == WRITE_KEY


def test_a_pass_that_comes_with_a_dead_heartbeat_is_not_used(plc):
    plc.accepted()
    plc.station.beating = False
    plc.wait(2.05)
    plc.station.show(5, 7)
    plc.scan(50)
    assert not plc.block["passed"]
    assert not plc.block["done"]
    plc.station.beating = True
    plc.scan(50)
    assert not plc.block["passed"]
    assert plc.block["discarded"] == 1
    assert not plc.block["busy"]


def test_after_a_lost_heartbeat_a_held_inspect_triggers_nothing(plc):
    plc.accepted()
    plc.station.beating = False
    plc.wait(2.05)
    plc.station.beating = True
    plc.station.flags("online", "trigger_ready")
    plc.scan(20, fruit_id=8)
    assert plc.block["alive"]
    assert (plc.block["busy"], plc.block["done"]) == (False, False)
    assert "trigger" not in plc.control()
    plc.scan(3, inspect=False)
    plc.scan(inspect=True)
    assert "trigger" in plc.control()


@pytest.mark.parametrize("shown", ["before the stop", "after it"])
def test_a_plc_that_was_stopped_passes_no_fruit_on_the_result_of_the_one_before(plc, shown):
    plc.accepted()
    if shown == "before the stop":
        plc.station.show(5, 7)
        plc.scan()
        assert plc.block["passed"]
    plc.library.now_s += 600
    plc.station.show(5, 7)
    plc.scan(first_scan=True)
    assert [name for name in OUTPUTS if not zero(plc.block[name])] == []
    for _ in range(20):
        plc.scan(first_scan=False, fruit_id=8)
        assert not plc.block["done"]
        assert not plc.block["passed"]
    plc.station.flags("online", "trigger_ready")
    plc.scan(5)
    assert plc.block["alive"]
    assert plc.control() == {"enable"}, "a new rising edge is needed"
    plc.accepted(fruit_id=9)
    plc.station.show(6, 9)
    plc.scan()
    assert plc.block["passed"]


@pytest.mark.parametrize("shown", [False, True], ids=["before the result", "after the result"])
def test_a_fruit_in_place_while_the_station_had_lost_the_plc_does_not_pass(plc, shown):
    plc.accepted()
    if shown:
        plc.station.show(5, 7)
        plc.scan()
        assert plc.block["passed"]
    plc.station.set(more_status=BY_NAME["more_status"].flags(["enable_inhibited"]))
    plc.scan()
    assert not plc.block["passed"]
    plc.station.set(more_status=0)
    plc.station.show(5, 7)
    plc.scan(3)
    assert (plc.block["done"], plc.block["passed"]) == (True, False)
    plc.station.flags("online", "trigger_ready")
    plc.scan(inspect=False)
    plc.accepted(fruit_id=9)
    plc.station.show(6, 9)
    plc.scan()
    assert plc.block["passed"], "the next fruit"


def test_a_lost_link_is_a_lost_heartbeat_and_one_lost_exchange_is_not(plc):
    plc.accepted()
    plc.scan(connected=False)
    assert plc.block["busy"]
    plc.wait(2.5)
    assert not plc.block["alive"]
    assert not plc.block["busy"]


def test_the_first_words_read_are_no_sign_of_life(plc):
    plc.station.beating = False
    plc.station.set(station_heartbeat=1234)
    plc.scan(20)
    assert not plc.block["alive"]
    plc.station.beating = True
    plc.scan()
    assert plc.block["alive"]


def test_the_plcs_own_heartbeat_changes_in_each_scan_whatever_the_station_does(plc):
    plc.station.beating = False
    seen = set()
    for _ in range(300):
        plc.scan()
        seen.add(plc.written("plc_heartbeat"))
    assert len(seen) == 300
    plc.block.variables["plc_heartbeat"] = 65_535
    plc.scan()
    assert plc.written("plc_heartbeat") == 0


def test_the_result_of_another_fruit_is_acknowledged_and_not_used(plc):
    plc.accepted()
    plc.station.show(4, 6)
    plc.scan()
    assert (plc.block["done"], plc.block["passed"], plc.block["discarded"]) == (False, False, 1)
    assert plc.written("acknowledged_sequence") == 4
    assert "acknowledge" in plc.control()
    plc.station.show(5, 7)
    plc.scan()
    assert "acknowledge" not in plc.control()
    plc.scan()
    assert (plc.block["done"], plc.block["passed"]) == (True, True)
    assert plc.block["result"]["sequence"] == 5


def test_a_result_left_over_is_cleared_before_the_station_counts_as_ready(plc):
    plc.station.show(4, 7)
    plc.scan(3)
    assert not plc.block["ready"]
    assert plc.block["discarded"] == 1
    plc.station.flags("online", "trigger_ready")
    plc.scan(2)
    assert plc.block["ready"]
    assert zero(plc.block["result"])


@pytest.mark.parametrize("copy", ["result_sequence_again", "result_sequence_end"])
def test_a_torn_result_is_not_used_and_not_acknowledged(plc, copy):
    plc.accepted()
    plc.station.show(5, 7, **{copy: 4})
    plc.scan(3)
    assert not plc.block["done"]
    assert plc.control() == {"enable"}
    plc.station.set(**{copy: 5})
    plc.scan()
    assert plc.block["passed"]


def test_a_result_that_is_not_valid_is_not_used(plc):
    plc.accepted()
    plc.station.show(5, 7)
    plc.station.flags("online", "inspecting")
    plc.scan(3)
    assert not plc.block["done"]


def test_a_refusal_has_its_reason(plc):
    plc.scan(3)
    plc.scan(inspect=True)
    plc.station.set(last_refusal=BY_NAME["last_refusal"].code("recipe_changing"), last_refused_trigger_id=7)
    plc.station.flags("online", "trigger_acknowledged", "missed")
    plc.scan()
    assert (plc.block["done"], plc.block["refused"], plc.block["passed"]) == (True, True, False)
    assert plc.block["refusal"] == BY_NAME["last_refusal"].code("recipe_changing")
    assert plc.control() == {"enable"}


@pytest.mark.parametrize("case", ["not ready", "id 0", "id used", "disabled", "bit not fallen"])
def test_the_block_itself_refuses_what_the_station_would(plc, case):
    plc.station.set(accepted_trigger_id=3)
    match case:
        case "not ready":
            plc.station.flags("online")
        case "id 0":
            plc.scan(fruit_id=0)
        case "id used":
            plc.scan(fruit_id=3)
        case "disabled":
            plc.scan(enable=False)
        case _:
            plc.station.flags("online", "trigger_ready", "trigger_acknowledged")
    plc.scan(3)
    plc.scan(inspect=True)
    assert (plc.block["done"], plc.block["refused"], plc.block["refusal"]) == (True, True, 0)
    assert "trigger" not in plc.control()


def test_no_answer_ends_in_a_time_out(plc):
    plc.scan(3)
    plc.scan(inspect=True)
    plc.wait(2.05)
    assert (plc.block["done"], plc.block["timed_out"], plc.block["passed"]) == (True, True, False)
    assert "trigger" not in plc.control()


def test_no_result_in_time_diverts_and_the_late_one_is_discarded(plc):
    plc.accepted()
    plc.wait(20.05)
    assert (plc.block["done"], plc.block["timed_out"], plc.block["passed"]) == (True, True, False)
    plc.station.show(5, 7)
    plc.scan(3)
    assert plc.block["timed_out"]
    assert not plc.block["passed"]
    assert plc.block["discarded"] == 1


def test_another_fruit_needs_another_rising_edge(plc):
    plc.accepted()
    plc.station.show(5, 7)
    plc.scan()
    plc.station.flags("online", "trigger_ready")
    plc.scan(5)
    assert "trigger" not in plc.control()
    assert plc.block["done"]


@pytest.mark.parametrize("bit", ["command_done", "command_failed"])
def test_a_change_of_recipe(plc, bit):
    plc.station.set(command_sequence_echo=65_535)
    plc.scan(3)
    plc.scan(change_recipe=True, recipe_number=12)
    assert plc.control() == {"enable", "execute_command"}
    assert [plc.written(name) for name in ("command_code", "command_argument", "command_sequence")] == [1, 12, 1]
    plc.station.flags("online", "trigger_ready", bit)
    plc.scan()
    assert plc.block["recipe_busy"], "the bit of another command"
    plc.station.set(command_sequence_echo=1)
    plc.scan()
    assert not plc.block["recipe_busy"]
    assert (plc.block["recipe_done"], plc.block["recipe_failed"]) == (bit == "command_done", bit == "command_failed")
    assert plc.control() == {"enable"}


def test_a_change_of_recipe_that_never_ends_has_failed(plc):
    plc.scan(3)
    plc.scan(change_recipe=True, recipe_number=12)
    plc.wait(30.05)
    assert (plc.block["recipe_busy"], plc.block["recipe_done"], plc.block["recipe_failed"]) == (False, False, True)


def test_enable_falls_while_the_station_inhibits_it(plc):
    plc.scan(3)
    assert plc.control() == {"enable"}
    plc.station.set(more_status=BY_NAME["more_status"].flags(["enable_inhibited"]))
    plc.scan(2)
    assert plc.control() == frozenset()
    plc.station.set(more_status=0)
    plc.scan()
    assert plc.control() == {"enable"}


def test_a_lot_goes_over_as_it_is(plc):
    lot = [0x4C31, *[0] * 15]
    plc.scan(3, lot=lot, latch_lot=True, clear_error=True)
    assert plc.written("lot") == "L1"
    assert plc.control() == {"enable", "latch_lot", "clear_error"}


STEPS = st.lists(
    st.tuples(
        st.sampled_from(["show", "torn", "gone", "accept", "refuse", "freeze", "beat", "inspect", "release", "wait"]),
        st.integers(1, 4),
    ),
    max_size=40,
)


def play(plc, what, number, sequence):
    """One step of a station and a line gone mad."""
    station = plc.station
    match what:
        case "show":
            station.show(sequence, number)
        case "torn":
            station.show(sequence, number, result_sequence_again=sequence - 1)
        case "gone":
            station.flags("online", "trigger_ready")
        case "accept":
            station.set(accepted_trigger_id=number)
            station.flags("online", "trigger_acknowledged", "inspecting")
        case "refuse":
            station.flags("online", "trigger_acknowledged", "missed")
        case "freeze" | "beat":
            station.beating = what == "beat"
            plc.wait(2.1)
        case "inspect" | "release":
            plc.scan(inspect=what == "inspect", fruit_id=number)
        case _:
            plc.wait(0.5 * number)


PASSING = [("inspect", 1), ("accept", 1), ("show", 1)]


@given(STEPS)
@example([("inspect", 1), ("accept", 1), ("release", 1), ("inspect", 2), ("show", 1)])
@example(PASSING)
@settings(max_examples=30, deadline=None)
def test_whatever_comes_only_the_asked_fruits_own_whole_result_passes(make_plc_for_examples, steps):
    plc = make_plc_for_examples()
    plc.scan(3)
    block, in_place = plc.block, False
    for sequence, (what, number) in enumerate(steps, start=1):
        was_busy = block["busy"]
        play(plc, what, number, sequence)
        plc.scan()
        in_place = what != "release" and (in_place or (block["busy"] and not was_busy))
        if block["passed"]:
            result = block["result"]
            assert in_place, "inspect was high in each scan since its rising edge"
            assert block["done"]
            assert block["alive"]
            assert plc.inputs["inspect"]
            assert result["trigger_id"] == block["asked_id"]
            assert result["sequence"] == result["sequence_again"] != 0
        if block["may_move"]:
            assert block["alive"]
            assert not block["busy"], "the arm may be on its way to the fruit"
        if not block["alive"]:
            assert all(zero(block[name]) for name in OUTPUTS)
    if steps == PASSING:
        assert (block["passed"], block["may_move"]) == (True, True), "what is asserted above is asserted of a fruit"
