"""The life of an inspection in the records, over restarts."""

import asyncio
import shutil
import sqlite3
import threading
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from station.channel.line import Outcome, Reason
from station.messages import records as messages
from station.records.errors import (
    BadRecordError,
    DiskFullError,
    LockedError,
    RecordsClosedError,
    UnknownInspectionError,
)
from station.records.lots import read_lots, start_lot
from station.records.model import AlarmEntry, StoredAlarm
from station.records.write_requests import add_event
from tests.records.causes import because
from tests.stored_inspection import read_record


def test_a_trigger_goes_its_way_from_begin_to_acknowledged(opened, scenario, trigger, failed):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            assert (await records.open_inspections()).running == ((sequence, 7),)
            outcome = await records.conclude(sequence, failed)
            assert outcome.outcome == "FAIL"
            assert outcome.reasons == (Reason.AREA_OVER_LIMIT, Reason.EARLY_STOP)
            assert (outcome.trigger_id, outcome.encoder, outcome.lot) == (7, 1234, "A-17")
            assert (outcome.recipe_number, outcome.recipe_checksum) == (1, trigger.recipe.checksum)
            assert (await records.open_inspections()).ended == (outcome,)
            assert await records.acknowledged(sequence) == 0, "the PLC cannot have taken what was not published to it"
            assert await records.published(outcome)
            assert not await records.published(outcome)
            assert await records.acknowledged(sequence) == 1
            assert await records.acknowledged(sequence) == 0
            assert await records.open_inspections() == type(await records.open_inspections())((), ())
            full = read_record(records, sequence)
            assert full.judged == failed
            assert full.trigger == trigger
            assert full.standing == outcome
            assert full.boot == "boot-1"

    scenario(steps)


def test_numbers_go_on_over_restarts(opened, scenario, trigger):
    async def steps():
        given_numbers = []
        for _ in range(3):
            async with opened() as records:
                given_numbers += [await records.begin(trigger) for _ in range(2)]
        assert given_numbers == [1, 2, 3, 4, 5, 6]

    scenario(steps)


def test_a_request_that_fails_half_way_leaves_nothing_and_the_others_of_its_transaction_are_stored(opened, scenario):
    async def steps():
        def half(connection):
            start_lot(connection, "half", "Hill Farm", ("Ida", "operator"))
            raise BadRecordError(messages.AUDIT_VALUE(value="x", words="no JSON"), messages.SEE_LOG())

        async with opened() as records:
            changes = (half, lambda connection: start_lot(connection, "whole", "Hill Farm", ("Ida", "operator")), half)
            ended = await asyncio.gather(*map(records.change, changes), return_exceptions=True)
            assert [type(each) is BadRecordError for each in ended] == [True, False, True]
            lots = await records.change(lambda connection: read_lots(connection, 10))
            assert [lot.name for lot in lots] == ["whole"]

    scenario(steps)


def test_the_first_conclusion_stands(opened, scenario, trigger, passed, failed):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            first = await records.conclude(sequence, failed)
            assert await records.conclude(sequence, passed) == first
            assert read_record(records, sequence).judged == failed

    scenario(steps)


@pytest.mark.parametrize("published_first", [True, False])
def test_what_the_plc_was_told_overrules_what_was_judged(opened, scenario, trigger, passed, published_first):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            judged = None if published_first else await records.conclude(sequence, passed)
            outcome = Outcome(
                **dict[str, Any](
                    {
                        **(judged.model_dump() if judged else _bare(sequence)),
                        "outcome": "NO_RESULT",
                        "reasons": (Reason.LATE,),
                        "late": True,
                    }
                )
            )
            assert await records.published(outcome)
            if published_first:
                assert await records.conclude(sequence, passed) == outcome
            assert (await records.open_inspections()).ended == (outcome,)
            full = read_record(records, sequence)
            assert full.standing == outcome
            assert full.judged == passed, "the judged outcome is stored beside it"

    scenario(steps)


def _bare(sequence: int) -> dict[str, Any]:
    return {
        "sequence": sequence,
        "trigger_id": 7,
        "partial": True,
        "simulated": True,
        "area_mm2": None,
        "area_px": None,
        "closing_mm": None,
        "confidence": None,
        "recipe_number": 1,
        "recipe_checksum": 5,
        "began_utc_ms": 1,
        "ended_utc_ms": 2,
        "duration_ms": 1,
        "encoder": 0,
        "lot": "A-17",
    }


def _station_lost(sequence: int) -> Outcome:
    fields: dict[str, Any] = {"outcome": "NO_RESULT", "reasons": (Reason.STATION_LOST,), "late": False}
    return Outcome(**(_bare(sequence) | fields))


def test_a_restart_ends_what_was_not_surely_delivered(opened, scenario, trigger, passed, failed):
    async def steps():
        async with opened() as records:
            sized = replace(trigger, fruit_length_mm_x10=483, size_class=3)
            running, judged, published, acknowledged = [await records.begin(sized) for _ in range(4)]
            await records.conclude(judged, passed)
            for sequence in (published, acknowledged):
                await records.published(await records.conclude(sequence, failed))
            with sqlite3.connect(records.folder / "records.sqlite3") as other:
                other.execute("UPDATE inspections SET acknowledged_utc_ms = 1 WHERE sequence = ?", (acknowledged,))
            other.close()
        async with opened() as records:
            assert records.lost == (running, judged)
            was_open = await records.open_inspections()
            assert {(each.fruit_length_mm_x10, each.size_class) for each in was_open.ended} == {(483, 3)}
            assert was_open.running == ()
            assert [(outcome.sequence, outcome.outcome) for outcome in was_open.ended] == [
                (running, "NO_RESULT"),
                (judged, "NO_RESULT"),
                (published, "FAIL"),
            ]
            assert was_open.ended[0].reasons == was_open.ended[1].reasons == (Reason.STATION_LOST,)
            assert was_open.ended[0].partial
            assert read_record(records, judged).judged == passed
            assert read_record(records, running).judged is None
            # the interface outlived the station, and had shown the outcome just before: that one remains
            shown = Outcome(**dict[str, Any]({**was_open.ended[1].model_dump(), "outcome": "PASS", "reasons": ()}))
            assert await records.published(shown)
            assert read_record(records, judged).standing == shown

    scenario(steps)


def test_an_unknown_inspection_is_refused(opened, scenario, passed, trigger):
    async def steps():
        async with opened() as records:
            for request in (records.conclude(1, passed), records.published(_station_lost(1))):
                with pytest.raises(UnknownInspectionError):
                    await request
            with pytest.raises(UnknownInspectionError):
                read_record(records, 1)
            assert await records.begin(trigger) == 1, "a refused one takes no number"

    scenario(steps)


@pytest.mark.parametrize(
    "change", [{"reasons": ("late",)}, {"confidence": 1.5}, {"duration_ms": -1}, {"outcome": "FAIL"}, {"area_px": -3}]
)
def test_a_malformed_record_is_refused_and_the_inspection_stays_open(opened, scenario, trigger, passed, change):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            with pytest.raises(BadRecordError):
                await records.conclude(sequence, replace(passed, **change))
            assert (await records.open_inspections()).running == ((sequence, 7),)
            assert (await records.conclude(sequence, passed)).outcome == "PASS"

    scenario(steps)


def test_a_trigger_that_no_outcome_could_be_told_of_is_refused_at_the_door(opened, scenario, trigger):
    async def steps():
        async with opened() as records:
            changes = {"lot": "x" * 33, "trigger_id": 0, "encoder": -1, "size_class": 65_536, "began_utc_ms": -1}
            for name, value in changes.items():
                with pytest.raises(BadRecordError):
                    await records.begin(replace(trigger, **{name: value}))
        async with opened() as records:
            assert records.lost == ()

    scenario(steps)


def test_an_odd_figure_costs_no_record(opened, scenario, trigger, passed):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            await records.conclude(sequence, replace(passed, measures={"slope": float("nan"), "note": "é\x00"}))
            full = read_record(records, sequence)
            assert full.judged is not None
            assert full.judged.measures == {"slope": None, "note": "é\x00"}

    scenario(steps)


def test_requests_that_come_together_share_a_commit(opened, scenario, trigger):
    async def steps():
        async with opened() as records:
            before = records.status().writes
            numbers = await asyncio.gather(*(records.begin(trigger) for _ in range(200)))
            assert sorted(numbers) == list(range(1, 201))
            assert records.status().writes - before < 100

    scenario(steps)


def test_one_bad_request_does_not_undo_its_neighbours(opened, scenario, trigger, passed):
    async def steps():
        async with opened() as records:
            answers = await asyncio.gather(
                records.begin(trigger), records.conclude(99, passed), records.begin(trigger), return_exceptions=True
            )
            assert [answers[0], answers[2]] == [1, 2]
            assert isinstance(answers[1], UnknownInspectionError)
            assert len((await records.open_inspections()).running) == 2

    scenario(steps)


def test_a_trigger_below_the_reserve_does_not_undo_its_neighbours(opened, scenario, trigger, folder, monkeypatch):
    gate = threading.Event()

    async def steps():
        async with opened() as records:
            holding = asyncio.create_task(records.change(lambda _: gate.wait(30)))
            await asyncio.sleep(0)  # each of these is queued in its first step
            monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10**9, 10**9, 0))
            answers = asyncio.gather(
                records.change(lambda connection: add_event(connection, "before", None, {})),
                records.begin(trigger),
                records.change(lambda connection: add_event(connection, "after", None, {})),
                return_exceptions=True,
            )
            await asyncio.sleep(0)
            gate.set()
            before, refused, after = await answers
            await holding
            assert (before, after) == (None, None)
            assert isinstance(refused, DiskFullError)
            assert refused.cause.id == messages.RESERVE_REACHED.id
            assert (await records.open_inspections()).running == ()

    scenario(steps)
    with sqlite3.connect(folder / "records.sqlite3") as connection:
        names = connection.execute("SELECT name FROM events WHERE name IN ('before', 'after')").fetchall()
        assert names == [("before",), ("after",)]
    connection.close()


def test_clock_steps_change_no_order_and_no_duration(opened, scenario, trigger, passed):
    async def steps():
        hour_ms = 3_600_000
        async with opened() as records:
            for step_ms in (0, -hour_ms, hour_ms):
                sequence = await records.begin(replace(trigger, began_utc_ms=trigger.began_utc_ms + step_ms))
                ended = replace(passed, ended_utc_ms=trigger.began_utc_ms - step_ms)
                outcome = await records.conclude(sequence, ended)
                assert (outcome.duration_ms, outcome.ended_utc_ms) == (3210, ended.ended_utc_ms)
            assert [outcome.sequence for outcome in (await records.open_inspections()).ended] == [1, 2, 3]

    scenario(steps)


def test_alarms_and_events_outlive_a_restart(opened, scenario, folder):
    rows = (
        StoredAlarm("camera_lost", "unacknowledged", 5, 6, "USB"),
        StoredAlarm("disk_full", "shelved", 7, 8, "", 99),
    )

    async def steps():
        async with opened() as records:
            await records.save_alarms([StoredAlarm("old", "active", 1, 1)])
            await records.save_alarms(rows, [AlarmEntry(5, "camera_lost", "raised", "USB", 3)])
        async with opened() as records:
            assert await records.load_alarms() == rows
            await records.save_alarms([])
            assert await records.load_alarms() == ()

    scenario(steps)
    with sqlite3.connect(folder / "records.sqlite3") as connection:
        assert connection.execute("SELECT id, change, sequence FROM alarms_log").fetchall() == [
            ("camera_lost", "raised", 3)
        ]
        assert connection.execute("SELECT count(*) FROM events WHERE name = 'opened'").fetchone() == (2,)
    connection.close()


def test_a_second_station_is_refused(opened, scenario):
    async def steps():
        async with opened():
            with pytest.raises(LockedError, check=because(messages.ANOTHER_STATION)):
                async with opened():
                    pass
        async with opened():
            pass

    scenario(steps)


def test_closed_records_refuse_in_words(opened, scenario, trigger):
    async def steps():
        async with opened() as records:
            await records.close()
            with pytest.raises(RecordsClosedError):
                await records.begin(trigger)
            await records.close()

    scenario(steps)


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(st.sampled_from(["begin", "pass", "fail", "publish", "take", "restart"]), st.integers(0, 5)),
        min_size=5,
        max_size=25,
    )
)
def test_any_history_has_one_outcome_for_each_trigger(  # noqa: C901 (a model and its steps)
    opened, scenario, tmp_path, trigger, passed, failed, history
):
    """The records against a model of the contract: sequence to (judged, standing, published, acknowledged)."""
    folder = tmp_path / f"{abs(hash(tuple(history)))}-{len(list(tmp_path.iterdir()))}"
    model: dict[int, list] = {}

    async def steps():
        rest = list(history)
        while rest:
            async with opened(folder) as records:
                for row in model.values():
                    if not row[2]:
                        row[1] = "NO_RESULT"
                while rest:
                    verb, choice = rest.pop(0)
                    if verb == "restart":
                        break
                    await carry_out(records, verb, choice)
                was_open = await records.open_inspections()
                assert was_open.running == tuple((n, 7) for n, row in model.items() if row[1] is None)
                ended = {outcome.sequence: outcome.outcome for outcome in was_open.ended}
                assert ended == {n: row[1] for n, row in model.items() if row[1] is not None and not row[3]}
                for n, row in model.items():
                    full = read_record(records, n)
                    assert (full.judged.outcome if full.judged else None) == row[0]

    async def carry_out(records, verb, choice):
        if verb == "begin":
            sequence = await records.begin(trigger)
            assert sequence == len(model) + 1
            model[sequence] = [None, None, False, False]
            return
        if not model:
            return
        sequence = sorted(model)[choice % len(model)]
        row = model[sequence]
        if verb in {"pass", "fail"}:
            record = passed if verb == "pass" else failed
            standing = await records.conclude(sequence, record)
            if row[0] is None:
                row[0], row[1] = record.outcome, row[1] or record.outcome
            assert standing.outcome == row[1]
        elif verb == "publish":
            assert await records.published(_station_lost(sequence)) is not row[2]
            if not row[2]:
                row[1], row[2] = "NO_RESULT", True
        elif verb == "take":
            taken = [n for n, other in model.items() if n <= sequence and other[2] and not other[3]]
            assert await records.acknowledged(sequence) == len(taken)
            for n in taken:
                model[n][3] = True

    scenario(steps)
