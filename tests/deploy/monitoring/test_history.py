"""Days of a line that never was, backfilled: each trouble raises its alert and no other, and sound days raise none."""

import pytest

from benchmarks.monitoring.history import NO_COMPACTION, fired_alerts, record
from benchmarks.monitoring.month import DAY_S, HOUR_S, Plan, troubles, write_history
from benchmarks.monitoring.prometheus import running, write_configuration
from station.runtime.observability.metrics_table import TABLE

BEGIN_S = 1_789_344_000
"""A midnight, UTC."""
PLAN = Plan(BEGIN_S, days=5, step_s=240, troubles=troubles(1, 2, 3))
LATEST_S = 1.5 * HOUR_S
"""An alert fires for as long at most after its cause has gone: the windows of an hour have to pass."""


@pytest.mark.timeout(600)
def test_each_trouble_is_told_by_its_alert_and_by_no_other(promtool, tmp_path):
    data = tmp_path / "data"
    seen = write_history(PLAN, data)
    assert {row.name for row in TABLE.values()} <= {family for family, _ in seen}
    record(PLAN, tmp_path)
    with running(tmp_path, write_configuration(tmp_path, "1m", {}), *NO_COMPACTION) as prometheus:
        found = fired_alerts(prometheus, PLAN)
        counted = prometheus.now("sum(station_inspections_total)", PLAN.end_s)
    assert counted[0].points[0][1] > 1000
    left = list(found)
    for trouble in PLAN.troubles:
        begin_s, end_s = BEGIN_S + trouble.begin_s, BEGIN_S + trouble.end_s + LATEST_S
        its = [each for each in left if begin_s <= each.begin_s and each.end_s <= end_s]
        assert {each.alert for each in its} == set(trouble.alerts), trouble.kind
        left = [each for each in left if each not in its]
    assert left == [], "an alert without a cause"
    assert found[0].begin_s > BEGIN_S + DAY_S, "the first day is sound"
