"""`station plc run` on the wire: a PLC on one side, a scripted station on the other."""

import asyncio
import signal
from typing import Any

import pytest

from plc_interface.handshake.view import STATION_LOST_CODE, lot_checksum
from station.channel.line import CommandDone, PackmlState, Reason, Refusal
from station.messages import can, line
from station.messages.message import verbatim


@pytest.mark.parametrize("order", ["high_first", "low_first"])
def test_a_fruit_from_enable_to_acknowledge(cell, until, order):
    async def scenario():
        async with cell(modbus_word_order=order) as made:
            station, plc = made.station, await made.plc()
            await plc.set("latch_lot", lot="LOT-2026/7")
            await plc.wait("lot_latched", latched_lot_checksum=lot_checksum("LOT-2026/7"))
            await plc.arm("buffer_results")
            seen = await plc.trigger(4711, encoder=70_000)
            assert {"online", "inspecting", "acquiring", "simulated", "writer_owned"} <= seen["status"]
            assert (seen["accepted_trigger_id"], seen["packml_state"], seen["active_recipe"]) == (4711, "starting", 3)
            await plc.wait("inspecting", packml_state="execute")
            assert seen["alarms"] == {"alarm_1", "alarm_3"}
            assert (await plc.group("more_status"))["alarms_33_to_64"] == {"alarm_33", "alarm_64"}
            assert seen["result_deadline_ms"] == 60_300
            station.finish("FAIL", Reason.AREA_OVER_LIMIT, Reason.EARLY_STOP)
            first = await plc.wait("result_valid", without="inspecting")
            assert (first["result_sequence"], first["result_trigger_id"]) == (101, 4711)
            assert first["result_sequence_again"] == 101
            assert (first["result_outcome"], first["result_reasons"]) == ("FAIL", {"area_over_limit", "early_stop"})
            assert first["result_flags"] == {"area_valid", "simulated"}
            assert (first["result_area_mm2_x100"], first["result_area_px"]) == (1234, 567)
            assert first["result_area_mm2"] == pytest.approx(12.34, rel=1e-6)
            assert (first["result_closing_mm_x100"], first["result_confidence_pct"]) == (150, 90)
            assert (first["result_encoder"], first["result_duration_ms"]) == (70_000, 900)
            assert first["result_ended_utc_ms"] == 1_700_000_000_900
            assert first["result_recipe_checksum"] == 0x12345678
            assert first["result_lot_checksum"] == lot_checksum("LOT-2026/7")
            await plc.set("acknowledge", acknowledged_sequence=101)
            await plc.wait(without="result_valid", acknowledged_sequence_echo=101, result_sequence=0)
            await plc.drop("acknowledge")
            await until(lambda: station.acknowledged == 101)
            await plc.trigger(4712)
            station.finish("PASS")
            second = await plc.wait("result_valid")
            assert (second["result_sequence"], second["result_trigger_id"]) == (102, 4712)
            assert second["result_flags"] == {"pass", "area_valid", "simulated"}
            assert ("toggle" in second["status"]) != ("toggle" in first["status"])
            await plc.write(acknowledged_sequence=102)
            await plc.wait(without="result_valid", free_places=8)
            counters = await plc.group("counters")
            assert {name: counters[f"count_{name}"] for name in ("triggers", "pass", "fail", "missed")} == {
                "triggers": 2,
                "pass": 1,
                "fail": 1,
                "missed": 0,
            }
            await until(lambda: station.published == station.outcomes)
            assert station.lines[-1].counters["count_pass"] == 1

    asyncio.run(scenario())


def test_every_refusal_is_told_with_its_reason_and_counted(cell, limit_s):
    async def scenario():
        limits = {"handshake_begin_deadline_s": limit_s, "handshake_station_lost_after_s": limit_s}
        async with cell(**limits) as made:
            station, plc = made.station, await made.plc()
            refusals: list[tuple[str, int]] = []

            async def refused(trigger_id: int) -> None:
                seen = await plc.trigger(trigger_id)
                assert "missed" in seen["status"]
                refusals.append((seen["last_refusal"], seen["last_refused_trigger_id"]))

            await plc.wait("online")
            await refused(1)
            await plc.arm()
            await refused(0)
            await plc.set("offline")
            await refused(2)
            await plc.drop("offline")
            for refusal in (Refusal.NOT_READY, Refusal.RECORDS_FULL):
                station.refusal = refusal
                await refused(3)
            station.refusal = None
            await plc.trigger(4)
            await refused(5)
            await refused(4)
            station.finish()
            await plc.wait("result_valid", free_places=0)
            await refused(6)
            assert "overrun" in (await plc.read())["status"]
            await plc.write(acknowledged_sequence=101)
            station.refusal = Refusal.BUSY
            assert "inspecting" not in (await plc.read())["status"], "its fruit is not released yet"
            await refused(6)
            station.refusal = None
            station.command_gate.clear()
            await plc.set("execute_command", command_code=1, command_argument=7, command_sequence=1)
            await plc.wait("command_executing")
            await refused(7)
            station.command_gate.set()
            await plc.wait("command_done")
            await plc.drop("execute_command")
            station.deaf = True
            await refused(8)
            await station.die()
            await plc.wait(without="online")
            await refused(9)
            assert refusals == [
                ("not_enabled", 1),
                ("bad_trigger_id", 0),
                ("offline", 2),
                ("not_ready", 3),
                ("records_full", 3),
                ("busy", 5),
                ("bad_trigger_id", 4),
                ("queue_full", 6),
                ("busy", 6),
                ("recipe_changing", 7),
                ("station_lost", 8),
                ("station_lost", 9),
            ]
            counters = await plc.group("counters")
            assert (counters["count_missed"], counters["count_overrun"], counters["count_accepted"]) == (12, 1, 1)
            await plc.set("clear_error")
            seen = await plc.read()
            assert not {"missed", "overrun"} & seen["status"]
            assert (seen["last_refusal"], seen["last_refused_trigger_id"]) == ("none", 0)

    asyncio.run(scenario())


def test_a_lot_with_a_barcode_readers_cr_fails_its_latch_and_nothing_else(cell, until):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            for heartbeat in (1, 2):
                await plc.beat(heartbeat, b"LOT 7\r")
                await plc.wait("trigger_ready", plc_heartbeat_echo=heartbeat)
            await until(lambda: station.lines[-1].plc_alive)
            assert station.lines[-1].faults == ()
            await plc.set("latch_lot")
            await plc.wait("trigger_ready", without="lot_latched", latched_lot_checksum=0)
            await until(lambda: [fault.what.id for fault in station.lines[-1].faults] == [line.BAD_LOT.id])
            await plc.drop("latch_lot")
            await plc.beat(3, b"LOT 7")
            await plc.set("latch_lot")
            await plc.wait("lot_latched", latched_lot_checksum=lot_checksum("LOT 7"))

    asyncio.run(scenario())


def test_no_fruit_is_begun_while_the_reject_gate_cannot_divert_it(cell, until):
    """An interface that this machine does not have: reported to the station, and every trigger is refused."""

    async def scenario():
        async with cell(can_enabled=True, can_interface="socketcan", can_channel="nocan7") as made:
            station, plc = made.station, await made.plc()
            await plc.wait("online")
            await plc.write(control=0)
            await plc.set("enable")
            await until(lambda: station.lines[-1].faults)
            (fault,) = station.lines[-1].faults
            assert fault.part == "can"
            assert fault.what.id == can.NOT_OPENED.id
            seen = await plc.trigger(1)
            assert (seen["last_refusal"], "trigger_ready" in seen["status"]) == ("not_ready", False)
            assert station.accepted == {}

    asyncio.run(scenario())


def test_eight_results_wait_and_none_is_dropped(cell):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            for trigger_id in range(1, 9):
                await plc.trigger(trigger_id)
                station.finish("PASS")
                await plc.wait(waiting_results=trigger_id, free_places=8 - trigger_id, result_trigger_id=1)
            seen = await plc.trigger(9)
            assert (seen["last_refusal"], seen["accepted_trigger_id"]) == ("queue_full", 8)
            for trigger_id in range(1, 9):
                seen = await plc.wait("result_valid", result_trigger_id=trigger_id)
                await plc.set("acknowledge", acknowledged_sequence=seen["result_sequence"])
                await plc.wait(without="result_valid", acknowledged_sequence_echo=100 + trigger_id)
                await plc.drop("acknowledge")
            await plc.wait(without="result_valid", waiting_results=0, free_places=8)

    asyncio.run(scenario())


def test_bits_that_the_plc_forgets_block_nothing(cell, until, limit_s):
    async def scenario():
        async with cell(handshake_handshake_timeout_s=limit_s) as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            await plc.set("trigger", trigger_id=1)
            await plc.wait("trigger_acknowledged")
            await plc.wait(without="trigger_acknowledged")
            station.finish()
            await plc.wait("result_valid")
            await plc.drop("trigger")
            await plc.trigger(2)
            station.finish()
            await plc.wait(waiting_results=2)
            await plc.set("acknowledge", acknowledged_sequence=101)
            await plc.wait("result_valid", result_trigger_id=2)
            await plc.write(acknowledged_sequence=102)
            await plc.wait(waiting_results=0)
            await plc.set("execute_command", command_code=2, command_sequence=5)
            await plc.wait("command_done", command_sequence_echo=5)
            await plc.wait(without="command_done", command_result="done")
            await plc.set("latch_lot", lot="A")
            await plc.wait("lot_latched")
            await plc.wait(without="lot_latched")
            await until(lambda: len(station.lines[-1].faults) == 4)
            assert {fault.what.id for fault in station.lines[-1].faults} == {
                line.TRIGGER_NOT_RESET.id,
                line.ACKNOWLEDGE_NOT_RESET.id,
                line.EXECUTE_NOT_RESET.id,
                line.LATCH_NOT_RESET.id,
            }
            assert (await plc.group("counters"))["count_communication"] == 4

    asyncio.run(scenario())


def test_a_plc_that_stands_still_or_goes_is_disarmed_and_its_results_are_kept(cell, until, limit_s):
    async def scenario():
        async with cell(handshake_plc_heartbeat_timeout_s=limit_s) as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            await plc.trigger(1)
            await plc.write(plc_heartbeat=1)
            await plc.write(plc_heartbeat=2)
            await until(lambda: station.lines[-1].plc_alive)
            await until(lambda: not station.lines[-1].plc_alive and station.lines[-1].enable_withdrawn)
            assert not station.lines[-1].enabled
            station.finish("FAIL", Reason.AREA_OVER_LIMIT)
            await plc.wait("result_valid", without="trigger_ready")
            await plc.set("enable")
            assert (await plc.trigger(2))["last_refusal"] == "not_enabled"
            await plc.arm("buffer_results")
            plc.close()
            await until(lambda: not station.lines[-1].plc_connected)
            assert station.lines[-1].enable_withdrawn
            again = await made.plc()
            seen = await again.wait("result_valid", result_trigger_id=1)
            assert "trigger_ready" not in seen["status"]
            await again.set("enable", "buffer_results")
            assert (await again.trigger(3))["last_refusal"] == "not_enabled"
            await again.arm("buffer_results")
            await again.trigger(4)
            assert (await again.group("counters"))["count_communication"] == 2

    asyncio.run(scenario())


def test_a_second_writer_is_refused(cell):
    async def scenario():
        async with cell() as made:
            plc = await made.plc()
            await plc.arm()
            with pytest.raises(AssertionError, match="exception 6"):
                await made.plc()
            assert (await plc.trigger(1))["accepted_trigger_id"] == 1

    asyncio.run(scenario())


def test_a_station_that_dies_while_it_inspects(cell, until, limit_s):
    async def scenario():
        async with cell(handshake_station_lost_after_s=limit_s) as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            await plc.trigger(1, encoder=5)
            await station.die()
            lost = await plc.wait("result_valid", "error", without="online")
            assert (lost["result_sequence"], lost["result_trigger_id"], lost["result_encoder"]) == (101, 1, 5)
            assert (lost["result_outcome"], lost["result_reasons"]) == ("NO_RESULT", {"station_lost"})
            assert lost["result_flags"] == {"partial", "simulated"}
            assert (lost["result_area_mm2_x100"], lost["result_area_px"]) == (-(2**31), 2**32 - 1)
            assert (lost["error_code"], lost["packml_state"], lost["active_recipe"]) == (
                STATION_LOST_CODE,
                "unknown",
                0,
            )
            before = (await plc.read())["station_heartbeat"]
            assert (await plc.trigger(2))["last_refusal"] == "station_lost"
            assert (await plc.read())["station_heartbeat"] == before
            await station.start()
            back = await plc.wait("online", "result_valid", "trigger_ready", result_trigger_id=1, station_boots=2)
            assert back["result_reasons"] == {"station_lost"}
            await until(lambda: 101 in station.published)
            assert station.published[101].reasons == (Reason.STATION_LOST,)
            await plc.write(acknowledged_sequence=101)
            await plc.trigger(3)
            station.finish("PASS")
            await plc.wait("result_valid", result_trigger_id=3, result_sequence=102)
            station.healthy = False
            beats = len(station.lines)
            still = await plc.read()
            await until(lambda: len(station.lines) > beats + 5)
            first = (await plc.wait("error"))["station_heartbeat"]
            assert (first - still["station_heartbeat"]) % 2**16 <= 2

    asyncio.run(scenario())


def test_a_fruit_stays_until_the_station_has_let_it_go(cell, limit_s):
    async def scenario():
        async with cell(handshake_station_lost_after_s=limit_s) as made:
            station, plc = made.station, await made.plc()
            station.packml_state = PackmlState.IDLE
            await plc.arm("buffer_results")
            await plc.wait(without="acquiring")
            station.packml_state = PackmlState.EXECUTE
            await plc.trigger(1)
            station.finish("PASS")
            await plc.wait("result_valid", "acquiring", without="inspecting")
            station.packml_state = PackmlState.COMPLETING
            await plc.wait("trigger_ready", "acquiring", packml_state="completing")
            station.packml_state = PackmlState.IDLE
            await plc.wait("trigger_ready", without="acquiring")
            station.packml_state = PackmlState.EXECUTE
            await plc.trigger(2)
            await station.die()
            await plc.wait("acquiring", "error", without="online")
            await station.start()
            await plc.wait("acquiring", "online", station_boots=2)
            station.packml_state = PackmlState.IDLE
            await plc.wait("online", without="acquiring")

    asyncio.run(scenario())


def test_a_result_that_comes_too_late_is_not_shown(cell, until):
    async def scenario():
        async with cell(handshake_result_margin_s=0.1) as made:
            station, plc = made.station, await made.plc()
            station.deadline_s = 0.2
            await plc.arm("buffer_results")
            await plc.trigger(1)
            station.running, running = None, station.running
            late = await plc.wait("result_valid")
            assert (late["result_outcome"], late["result_reasons"]) == ("NO_RESULT", {"late"})
            assert late["result_flags"] == {"late", "partial", "simulated"}
            await until(lambda: running in station.published)
            station.running = running
            station.finish("PASS")
            await until(lambda: "which is final" in made.log.read_text())
            assert (await plc.read())["result_outcome"] == "NO_RESULT"
            assert (await plc.group("counters"))["count_late"] == 1

    asyncio.run(scenario())


def test_an_interface_that_is_killed_continues_where_it_was(cell, until):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.set("latch_lot", lot="L")
            await plc.arm("buffer_results")
            for trigger_id in (1, 2):
                await plc.trigger(trigger_id)
                station.finish("PASS")
                await plc.wait(waiting_results=trigger_id)
            await plc.write(acknowledged_sequence=101)
            await until(lambda: station.acknowledged == 101)
            before = await plc.read()
            await plc.trigger(3)
            assert await made.end(signal.SIGKILL) == -signal.SIGKILL
            plc.close()
            await made.start()
            plc = await made.plc()
            seen = await plc.wait("online", "inspecting", without="trigger_ready")
            assert (seen["waiting_results"], seen["result_sequence"]) == (1, 0), "until the PLC writes what it took"
            await plc.write(acknowledged_sequence=101)
            seen = await plc.wait("online", "result_valid", "inspecting", without="trigger_ready")
            assert (seen["result_sequence"], seen["result_trigger_id"], seen["result_outcome"]) == (102, 2, "PASS")
            assert (seen["accepted_trigger_id"], seen["acknowledged_sequence_echo"]) == (3, 101)
            assert seen["latched_lot_checksum"] == lot_checksum("L")
            assert seen["interface_boots"] == before["interface_boots"] + 1
            station.finish("FAIL", Reason.GROWTH_OVER_LIMIT)
            await plc.wait(waiting_results=2)
            await plc.set("enable", "buffer_results")
            assert (await plc.trigger(4))["last_refusal"] == "not_enabled"
            await plc.write(acknowledged_sequence=102)
            await plc.wait("result_valid", result_trigger_id=3, result_outcome="FAIL")
            await plc.write(acknowledged_sequence=103)
            await plc.arm()
            assert (await plc.trigger(3))["last_refusal"] == "bad_trigger_id"
            assert (await plc.trigger(5))["accepted_trigger_id"] == 5

    asyncio.run(scenario())


def test_commands_are_carried_out_once(cell, limit_s):
    async def scenario():
        async with cell(handshake_command_deadline_s=limit_s, handshake_station_lost_after_s=limit_s) as made:
            station, plc = made.station, await made.plc()
            await plc.wait("online")

            async def order(code: int, argument: int, sequence: int) -> dict[str, Any]:
                await plc.set(
                    "execute_command", command_code=code, command_argument=argument, command_sequence=sequence
                )
                seen = await plc.wait(without="command_executing", command_sequence_echo=sequence)
                await plc.drop("execute_command")
                await plc.wait(without="command_done")
                return seen

            assert "command_done" in (await order(1, 7, 1))["status"]
            assert "command_done" in (await order(1, 7, 1))["status"]
            seen = await order(1, 8, 1)
            assert ("command_failed" in seen["status"], seen["command_result"]) == (True, "failed")
            assert [(c.command, c.argument) for c in station.commands] == [("change_recipe", 7)]
            station.command_done = CommandDone(done=False, why=verbatim("no recipe has this number"))
            assert (await order(1, 9, 2))["command_result"] == "failed"
            for code, sequence in ((0, 3), (99, 4)):
                assert (await order(code, 0, sequence))["command_result"] == "no_command"
            station.command_gate.clear()
            assert (await order(4, 2, 5))["command_result"] == "timed_out"
            await station.die()
            await plc.wait(without="online")
            assert (await order(2, 0, 6))["command_result"] == "station_lost"
            assert len(station.commands) == 3
            before = await plc.group("counters")
            await plc.set("reset_counters")
            after = await plc.group("counters")
            assert after["counters_epoch"] == before["counters_epoch"] + 1
            assert after["counters_reset_utc_ms"] > before["counters_reset_utc_ms"] > 1_700_000_000_000

    asyncio.run(scenario())


def test_the_end_is_orderly_and_a_second_interface_is_one_sentence(cell):
    async def scenario():
        async with cell() as made:
            plc = await made.plc()
            await plc.arm()
            code, message = await made.start_another()
            where = made.home / "plc"
            assert code == 2
            assert message == (
                f"station: another PLC interface runs in {where}: stop it, or give this one a home folder of its own\n"
            )
            ending = asyncio.create_task(made.end())
            await plc.wait(without="online")
            assert await ending == 0

    asyncio.run(scenario())


def test_a_note_that_is_spoilt_on_its_way_is_given_again(cell, until):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            await plc.trigger(4711)
            station.spoilt_notes = 1
            station.finish("PASS")
            await plc.wait("result_valid")
            await until(lambda: 101 in station.published)
            station.spoilt_notes = 1
            await plc.write(acknowledged_sequence=101)
            await until(lambda: station.acknowledged == 101)

    asyncio.run(scenario())


def test_a_report_of_before_the_trigger_that_comes_after_the_outcome_makes_no_station_ready(cell, until):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            station.packml_state = PackmlState.IDLE
            await plc.arm()
            station.report_gate.clear()
            reports = len(station.lines)
            await until(lambda: len(station.lines) > reports)
            await plc.trigger(4711)
            station.stopped = True
            station.finish("NO_RESULT", Reason.ARM_FAULT)
            seen = await plc.wait("result_valid")
            assert "trigger_ready" not in seen["status"]
            await plc.write(acknowledged_sequence=seen["result_sequence"])
            station.report_gate.set()
            while len(station.lines) < reports + 3:
                seen = await plc.read()
                assert "trigger_ready" not in seen["status"]
                assert "acquiring" in seen["status"]
            station.stopped = False
            await plc.wait("trigger_ready", without="acquiring")

    asyncio.run(scenario())


def test_an_outcome_whose_answer_is_lost_is_asked_for_again(cell):
    async def scenario():
        async with cell() as made:
            station, plc = made.station, await made.plc()
            await plc.arm("buffer_results")
            station.lost_waits = 1
            await plc.trigger(4711)
            station.finish("PASS")
            seen = await plc.wait("result_valid")
            assert seen["result_outcome"] == "PASS"

    asyncio.run(scenario())
