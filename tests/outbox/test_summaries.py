"""The summaries by hour are at all times those of the inspections themselves, and the dashboard's answers too."""

import asyncio
from datetime import UTC

import pytest

from benchmarks.fleet import plain
from benchmarks.fleet.year import equal
from benchmarks.monitoring.queries import panels, sql
from station.outbox.feed import read_batch
from station.outbox.postgresql import Postgresql
from station.settings.outbox import OutboxPostgresqlSettings

QUERIES = {panel.title: t["rawSql"] for panel in panels() for t in panel.targets if "rawSql" in t}
MONTH = ("2026-01-01T00:00:00+00:00", "2026-01-31T23:59:59+00:00")
EACH = {
    "hourly_outcomes": (
        "SELECT date_trunc('hour', began, 'UTC'), station, lot, coalesce(fruit, ''), coalesce(recipe_sha256, ''), "
        "outcome, count(*), min(began) FROM inspections GROUP BY 1, 2, 3, 4, 5, 6"
    ),
    "hourly_reasons": (
        "SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), outcome, reason, count(*) "
        "FROM inspections, unnest(reasons) AS reason GROUP BY 1, 2, 3, 4, 5"
    ),
    "hourly_values": (
        "SELECT date_trunc('hour', began, 'UTC'), station, coalesce(fruit, ''), quantity, bin_of(value), count(*) "
        "FROM inspections, LATERAL (VALUES ('area_mm2', area_mm2), ('duration_ms', duration_ms)) AS each "
        "(quantity, value) WHERE value IS NOT NULL GROUP BY 1, 2, 3, 4, 5"
    ),
}


def summaries(connection):
    """Return the stored summaries, and those computed from the inspections."""
    stored = {name: f"SELECT * FROM {name} WHERE inspections <> 0" for name in EACH}
    return tuple(
        {name: sorted(connection.execute(query).fetchall()) for name, query in queries.items()}
        for queries in (stored, EACH)
    )


@pytest.fixture
def published(server, fill, tmp_path):
    """Two stations' inspections of two hours each, published by the outbox in batches."""

    async def steps():
        for number, station in enumerate(("summed-1", "summed-2")):
            folder = tmp_path / station
            fill(folder, 1, 2400 + 100 * number, steps=0)
            settings = OutboxPostgresqlSettings(enabled=True, host=str(server.folder), user="fruit", tls="disable")
            async with Postgresql(settings, station).connected() as session:
                position = 0
                while (batch := read_batch(folder, station, position)).up_to > position:
                    await session.publish(batch)
                    position = batch.up_to

    asyncio.run(steps())
    return server


def test_summaries_follow_inserts_updates_and_deletes(published):
    with published.connect() as connection:
        stored, computed = summaries(connection)
        assert stored == computed
        assert all(stored.values())
        connection.execute("UPDATE inspections SET images_state = 'removed' WHERE station = 'summed-1'")
        assert summaries(connection) == (computed, computed)
        connection.execute(
            "UPDATE inspections SET outcome = 'FAIL', reasons = '{early_stop}', area_mm2 = 'NaN', duration_ms = 0, "
            "fruit = NULL, recipe_sha256 = NULL WHERE station = 'summed-1' AND sequence % 3 = 0"
        )
        stored, computed = summaries(connection)
        for name in ("hourly_reasons", "hourly_values"):
            assert stored[name] == computed[name]
        # a lot's first time remains where the fruit that had it is counted elsewhere: it never changes at a station
        assert [row[:-1] for row in stored["hourly_outcomes"]] == [row[:-1] for row in computed["hourly_outcomes"]]
        connection.execute("DELETE FROM inspections WHERE station = 'summed-1'")
        stored, computed = summaries(connection)
        assert stored == computed


def test_a_published_inspection_that_is_published_again_is_counted_once(published):
    with published.connect() as connection:
        before = summaries(connection)
        connection.execute(
            "WITH again AS (SELECT * FROM inspections WHERE station = 'summed-2') "
            "INSERT INTO inspections OVERRIDING USER VALUE SELECT * FROM again "
            "ON CONFLICT (station, sequence, began) DO UPDATE SET entry = EXCLUDED.entry"
        )
        assert summaries(connection) == before


def test_the_dashboard_answers_what_the_inspections_say(published):
    chosen = {"station": ["summed-1", "summed-2"], "fruit": ["strawberry", "raspberry"]}
    titles = plain.STATEMENTS.keys() & QUERIES.keys()
    assert len(titles) == 9
    with published.connect() as connection:
        for title in sorted(titles):
            ours, theirs = (
                connection.execute(sql(text, *MONTH, **chosen).encode()).fetchall()
                for text in (QUERIES[title], plain.STATEMENTS[title])
            )
            assert theirs, title
            assert equal(ours, theirs, plain.MEDIAN_TOLERANCE if title in plain.MEDIANS else 1e-9), title


@pytest.mark.parametrize(
    ("lot", "inspected", "began", "failed"),
    [("L7", "8", "09:05", 1 / 8), ("", "4", "10:05", 0.0)],
)
def test_a_lot_is_counted_whole_where_the_range_begins_within_it(server, lot, inspected, began, failed):
    """Fruit without a lot, which has no begin and no end, is that of the range."""
    with server.connect() as connection, connection.transaction(force_rollback=True):
        connection.execute(
            "INSERT INTO hourly_outcomes SELECT hour::timestamptz, 'halved', %s, 'blueberry', '', outcome, number, "
            "hour::timestamptz + interval '5 min' FROM (VALUES ('2026-01-05 09:00Z', 'PASS', 3), "
            "('2026-01-05 09:00Z', 'FAIL', 1), ('2026-01-05 10:00Z', 'PASS', 4)) AS two (hour, outcome, number)",
            (lot,),
        )
        of_second = ("2026-01-05T10:00:00Z", "2026-01-05T10:59:59Z")
        text = sql(QUERIES["Lots"], *of_second, station=["halved"], fruit=["blueberry"])
        [(*_, at, counted, share, unjudged)] = connection.execute(text.encode()).fetchall()
    assert (at.astimezone(UTC).strftime("%H:%M"), counted) == (began, inspected)
    assert (share, unjudged) == (failed, 0.0)


@pytest.mark.parametrize("title", ["Outcomes by day", "Failed by grower and day"])
@pytest.mark.parametrize(("zone", "midnight"), [("Europe/Berlin", "05 22:00"), ("utc", "05 00:00")])
def test_a_day_is_the_readers(server, title, zone, midnight):
    """At half past ten in the evening of UTC it is tomorrow in Berlin, in summer."""
    with server.connect() as connection, connection.transaction(force_rollback=True):
        connection.execute("SET LOCAL timezone = 'UTC'")
        connection.execute(
            "INSERT INTO hourly_outcomes VALUES ('2026-07-05 22:00Z', 'late', 'L7', 'blueberry', '', 'PASS', 1, "
            "'2026-07-05 22:30Z')"
        )
        of_days = ("2026-07-04T00:00:00Z", "2026-07-07T00:00:00Z")
        text = sql(QUERIES[title], *of_days, zone=zone, station=["late"], fruit=["blueberry"])
        [(at, *_)] = connection.execute(text.encode()).fetchall()
    assert at.astimezone(UTC).strftime("%d %H:%M") == midnight


def test_a_recipes_approval_is_listed_before_the_seals_of_later_fruit(server):
    with server.connect() as connection:
        connection.execute(
            "INSERT INTO audit SELECT 'sealing', number, md5(number::text), '', 0, "
            "'2026-01-05 12:00Z'::timestamptz + number * interval '1 s', 'station', 'station', "
            "CASE number WHEN 0 THEN 'recipe.approved' ELSE 'inspection.sealed' END, 'subject ' || number, '', "
            "NULL, NULL, 'test', number FROM generate_series(0, 200) AS number"
        )
        text = sql(QUERIES["Audit trail"], *MONTH, station=["sealing"])
        rows = connection.execute(text.encode()).fetchall()
    assert [row[3:5] for row in rows] == [("recipe.approved", "subject 0")]
