"""Search: for any conditions, a page has what a check of every inspection would find."""

import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from station.channel.line import Reason
from station.messages import records as messages
from station.messages.records import IMAGES_KEPT
from station.records.database import FILE_NAME, open_engine, reading
from station.records.errors import RecordsError
from station.records.lots import end_lot, read_lots, start_lot
from station.records.migration import migrate
from station.records.model import RecipeSnapshot
from station.records.search import Query, find, find_page
from station.records.search_index import HOUR_MS
from station.records.short_transaction import short_transaction
from station.records.write_requests import conclude, insert_trigger, publish
from station.vocabulary import LONGEST_GROWER
from tests.records.causes import because

IDA = ("Ida", "operator")
FRUIT = st.sampled_from(["strawberry", "strawberry, revised", "raspberry", None])
GROWERS = {"A": "Meier", "B": "Meier", "C": "Huber"}
LOTS = st.sampled_from(["A", "B", "C", "D", ""])
HOURS = st.integers(0, 4)
FAILED = st.sampled_from([("area_over_limit",), ("growth_over_limit", "early_stop"), ("early_stop",)])
ENDS = st.one_of(
    st.just(("PASS", ())),
    st.tuples(st.just("FAIL"), FAILED),
    st.tuples(st.just("NO_RESULT"), st.sampled_from([("no_contact",), ("late", "no_contact")])),
    st.none(),
)
QUERIES = st.builds(
    Query,
    lot=st.none() | LOTS,
    grower=st.none() | st.sampled_from(["Meier", "Huber", "nobody"]),
    from_utc_ms=st.none() | st.integers(0, 5 * HOUR_MS),
    to_utc_ms=st.none() | st.integers(1, 5 * HOUR_MS),
    outcome=st.none() | st.sampled_from(["PASS", "FAIL", "NO_RESULT"]),
    reason=st.none() | st.sampled_from([Reason.EARLY_STOP, Reason.NO_CONTACT, Reason.ARM_FAULT]),
    fruit=st.none() | st.sampled_from(["strawberry", "raspberry", "cherry"]),
)


def snapshot(fruit):
    name, _, revised = (fruit or "").partition(",")
    return RecipeSnapshot.of({"name": name, "plc_number": 1, "revised": revised}) if fruit else None


def wanted(inspected, query):
    """By a check of every one."""
    found = []
    for sequence, (lot, hour, end, fruit) in enumerate(inspected, start=1):
        began_utc_ms, (outcome, reasons) = hour * HOUR_MS + sequence, end or (None, ())
        holds = (
            (query.lot is None or lot == query.lot)
            and (query.grower is None or GROWERS.get(lot) == query.grower)
            and (query.from_utc_ms is None or began_utc_ms >= query.from_utc_ms)
            and (query.to_utc_ms is None or began_utc_ms < query.to_utc_ms)
            and (query.outcome is None or outcome == query.outcome)
            and (query.reason is None or query.reason in reasons)
            and (query.fruit is None or (fruit or "").startswith(query.fruit))
        )
        found += [sequence] if holds else []
    return found[::-1]


@given(
    inspected=st.lists(st.tuples(LOTS, HOURS, ENDS, FRUIT), max_size=40),
    queries=st.lists(QUERIES, min_size=1, max_size=8),
)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_found_is_what_there_is_also_where_the_clock_stepped(inspected, queries, trigger, passed):
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        engine = open_engine(folder / FILE_NAME, "rwc")
        migrate(engine, folder)
        with engine.begin() as connection:
            for lot, grower in GROWERS.items():
                start_lot(connection, lot, grower, IDA)
            for sequence, (lot, hour, end, fruit) in enumerate(inspected, start=1):
                began = replace(trigger, lot=lot, recipe=snapshot(fruit), began_utc_ms=hour * HOUR_MS + sequence)
                insert_trigger(connection, sequence, began, "boot")
                if end is not None:
                    record = replace(passed, outcome=end[0], reasons=end[1], curve=())
                    conclude(connection, sequence, record, {"PASS": IMAGES_KEPT(), "other": IMAGES_KEPT()})
        engine.dispose()
        with reading(folder) as connection:
            for query in queries:
                expected = wanted(inspected, query)
                assert list(find(connection, query)) == expected
                pages, below = [], None
                while True:
                    page = find_page(connection, query, 7, below)
                    pages += [row.sequence for row in page.rows]
                    below = page.below
                    if below is None:
                        break
                assert pages == expected


def test_an_outcome_told_otherwise_is_found_by_what_was_told(opened, scenario, folder, trigger, failed):
    async def steps():
        async with opened() as records:
            sequence = await records.begin(trigger)
            judged = await records.conclude(sequence, failed)
            outcome = judged.model_copy(update={"outcome": "NO_RESULT", "reasons": (Reason.CALLED_OFF,)})
            await records.published(outcome)

    scenario(steps)
    with reading(folder) as connection:
        assert list(find(connection, Query(reason=Reason.CALLED_OFF))) == [1]
        assert list(find(connection, Query(outcome="NO_RESULT"))) == [1]
        assert list(find(connection, Query(reason=Reason.AREA_OVER_LIMIT))) == []


def test_an_inspection_known_by_its_outcome_alone_is_found_by_its_time(opened, scenario, folder, trigger, passed):
    """It comes before others that began in other hours."""

    async def steps():
        async with opened() as records:
            for hour in (7, 7, 9):
                await records.begin(replace(trigger, began_utc_ms=hour * HOUR_MS))
            outcome = await records.conclude(2, passed)
            await records.change(lambda connection: connection.exec_driver_sql("DELETE FROM curve_points"))
            gone = "DELETE FROM inspections WHERE sequence = 2"
            await records.change(lambda connection: connection.exec_driver_sql(gone))
            early = outcome.model_copy(update={"began_utc_ms": 3 * HOUR_MS})
            await records.change(lambda connection: publish(connection, early, 3, "boot"))

    scenario(steps)
    with reading(folder) as connection:
        for hour, found in ((3, [2]), (7, [1]), (9, [3]), (8, [])):
            query = Query(from_utc_ms=hour * HOUR_MS, to_utc_ms=(hour + 1) * HOUR_MS)
            assert list(find(connection, query)) == found


def test_a_page_is_of_some_size(opened, scenario, folder):
    async def steps():
        async with opened():
            pass

    scenario(steps)
    with reading(folder) as connection, pytest.raises(RecordsError, check=because(messages.PAGE_TOO_LARGE)):
        find_page(connection, Query(), 1001)


def test_the_command_finds_by_what_was_told_of_lots(opened, scenario, folder, run_records, trigger, passed, failed):
    async def steps():
        async with opened() as records:
            for number in range(4):
                lot = "west" if number < 2 else "east"
                sequence = await records.begin(replace(trigger, lot=lot))
                await records.published(await records.conclude(sequence, failed if number % 2 else passed))
            result = run_records("lot", "start", "west", "--grower", "Meier", "--by", "ada")  # while the station runs
            assert result.output.startswith("west: Meier, began ")

    scenario(steps)
    result = run_records("list", "--grower", "Meier", "--reason", "early_stop")
    assert [line.split()[0] for line in result.output.splitlines()] == ["number", "2"]
    assert " west  Meier   strawberry  FAIL " in result.output
    assert "more: --below 4" in run_records("list", "--last", 1).output
    assert [line.split()[0] for line in run_records("list", "--below", 4, "--last", 2).output.splitlines()[:3]] == [
        "number",
        "3",
        "2",
    ]
    assert len(run_records("list", "--from", "2023-11-14T22:13:20", "--to", "2023-11-15").output.splitlines()) == 5
    refused = run_records("list", "--from", "yesterday")
    assert refused.exit_code == 2
    assert "write 2026-06-30" in refused.output
    other = run_records("lot", "start", "west", "--grower", "Huber")
    assert other.exception.cause.id == messages.ANOTHER_GROWER.id
    assert other.exception.cause.parameters["known"] == "Meier"
    assert run_records("lot", "start", "west", "--grower", "Huber", "--correct", "--by", "ada").exit_code == 0
    assert run_records("lot", "end", "west").output.startswith("west: Huber, began")
    with short_transaction(folder) as connection:
        (lot,) = read_lots(connection, 9)
        assert end_lot(connection, "west", IDA) == lot, "a lot ends once"
        assert lot.revision == 3
        query = "SELECT who, action, old, new FROM audit WHERE action LIKE 'lot%' ORDER BY seq"
        trail = connection.exec_driver_sql(query).all()
    assert [row.action for row in trail] == ["lot.told", "lot.told", "lot.ended"]
    assert trail[1][:3] == ("ada", "lot.told", '{"grower":"Meier"}')


def test_a_growers_name_is_as_long_as_the_panel_takes_it_except_one_that_is_stored(
    opened, scenario, folder, run_records
):
    async def steps():
        async with opened():
            pass

    scenario(steps)
    assert run_records("lot", "start", "west", "--grower", "M" * LONGEST_GROWER).exit_code == 0
    longer = "M" * (LONGEST_GROWER + 1)
    for correct in ((), ("--correct",)):
        refused = run_records("lot", "start", "west", "--grower", longer, *correct)
        assert refused.exit_code == 1
        assert refused.exception.cause == messages.LONG_GROWER(letters=LONGEST_GROWER + 1)
        assert refused.exception.remedy == messages.SHORTER_NAME(most=LONGEST_GROWER)
    with short_transaction(folder) as connection:
        (lot,) = read_lots(connection, 9)
        assert lot.grower == "M" * LONGEST_GROWER
        connection.exec_driver_sql("UPDATE lots SET grower = ?", (longer,))  # as an earlier version stored it
    assert run_records("lot", "end", "west").exit_code == 0
    assert run_records("lot", "start", "west", "--grower", longer).output.startswith(f"west: {longer}, began ")


def test_a_lot_that_is_started_again_runs_until_it_is_ended_again(opened, scenario, folder):
    async def steps():
        async with opened():
            pass

    scenario(steps)
    with short_transaction(folder) as connection:
        began = start_lot(connection, "west", "Meier", IDA)
        assert start_lot(connection, "west", "Meier", IDA) == began, "it runs"
        first = end_lot(connection, "west", IDA)
        assert start_lot(connection, "west", "Meier", IDA, correct=True) == first, "a correction starts nothing"
        again = start_lot(connection, "west", "Meier", IDA)
        assert (again.began_utc_ms, again.ended_utc_ms) == (began.began_utc_ms, None)
        second = end_lot(connection, "west", IDA)
        assert first.ended_utc_ms is not None
        assert second.ended_utc_ms is not None
        assert second.ended_utc_ms >= first.ended_utc_ms
        assert [each.revision for each in (began, first, again, second)] == [1, 2, 3, 4]
