"""A real Prometheus scrapes a demonstration, which publishes to a real PostgreSQL: every query is answered."""

import math

import pytest
from prometheus_client.parser import text_string_to_metric_families as parse

from benchmarks.archive import postgres
from benchmarks.monitoring.month import LINKS, PHASES
from benchmarks.monitoring.queries import panels, promql, rules, sql, used
from benchmarks.monitoring.site import STATION, WEEK, demonstration
from station.runtime.observability.metrics_table import TABLE, exposed_name
from tests.hosts import fresh_host

FRUITS = 3


def unanswered(site):
    """Rules and panels that Prometheus has nothing for."""
    queries = [
        *((f"rule {name}", expr) for name, expr in rules()),
        *(
            (f"{panel.board}: {panel.title}", promql(target["expr"], STATION, "1m", week=WEEK))
            for panel in panels()
            for target in panel.targets
            if "expr" in target
        ),
    ]
    assert len(queries) > 100
    answers = {what: site.prometheus.now(expr, site.at_s) for what, expr in queries}
    return [what for what, found in answers.items() if all(math.isnan(each.points[0][1]) for each in found)]


def empty(server, begin, end):
    """Panels that PostgreSQL has no rows for."""
    with server.connect() as connection:
        return [
            panel.title
            for panel in panels()
            for target in panel.targets
            if "rawSql" in target
            and not connection.execute(
                sql(target["rawSql"], begin, end, station=[STATION], fruit=["blueberry", "o'fruit"]).encode()
            ).fetchall()
        ]


@pytest.mark.timeout(600)
def test_every_question_is_answered_and_no_metric_is_unused(promtool, postgresql_programs, tmp_path):
    host = fresh_host()
    with (
        postgres.throwaway(postgresql_programs) as server,
        demonstration(tmp_path, server, FRUITS, host) as site,
    ):
        assert promtool("check", "metrics", given=site.metrics) == ""
        assert unanswered(site) == []
        assert empty(server, "2020-01-01", "2100-01-01") == []
        stored = site.prometheus.names()
        alive = {alert["labels"]["alertname"] for alert in site.prometheus.get("alerts")["alerts"]}
        assert "Watchdog" in alive
        loaded = [rule for group in site.prometheus.get("rules")["groups"] for rule in group["rules"]]
        assert [rule["name"] for rule in loaded if rule["health"] != "ok"] == []
    parts = ("_bucket", "_sum", "_count")
    scraped = {
        name: next((name.removesuffix(part) for part in parts if name.endswith(part)), name)
        for name in stored
        if name.startswith(("station_", "process_")) and ":" not in name
    }
    assert {exposed_name(row) for row in TABLE.values()} <= set(scraped.values()), "a metric that never appeared"
    families = {scraped[name] for name in used(set(scraped))}
    assert set(scraped.values()) - families == set(), "metrics that no query uses"
    values = {value for family in parse(site.metrics) for each in family.samples for value in each.labels.values()}
    assert {*LINKS, *PHASES} <= values, "the month that never was names what no station names"
