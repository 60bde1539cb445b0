"""Metrics as scraped: named by the conventions, bounded, and equal to the records."""

import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families as parse_openmetrics
from prometheus_client.parser import text_string_to_metric_families as parse

from station.channel.line import Reason, Refusal
from station.inspection.alarm_table import ALARMS, AlarmId
from station.outbox.status import DestinationStatus, OutboxStatus
from station.records.database import reading
from station.records.model import InspectionRecord, Trigger
from station.records.records import Records, Status
from station.records.search import Query, find_page
from station.runtime.observability import metrics_table
from station.runtime.observability.metrics_table import LABELS, TABLE, exposed_name
from station.settings.records import RecordsSettings

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "metrics.md"


def scraped(metrics):
    """Samples by their names and labels, as a Prometheus server reads them."""
    content, content_type = metrics.exposition()
    assert content_type.startswith("text/plain; version=")
    return {
        (sample.name, *sorted(sample.labels.items())): sample.value
        for family in parse(content.decode())
        for sample in family.samples
    }


def record_everything(metrics, outcome):
    metrics.inspection("strawberry", outcome, {"approach": 0.8}, 9.5)
    failed = outcome.model_copy(update={"outcome": "FAIL", "reasons": (Reason.AREA_OVER_LIMIT, Reason.EARLY_STOP)})
    metrics.inspection("strawberry", failed)
    late = {"outcome": "NO_RESULT", "reasons": (Reason.LATE,), "late": True, "area_mm2": None, "closing_mm": None}
    metrics.inspection("", outcome.model_copy(update=late))
    metrics.frame("good")
    metrics.frame("torn", 2)
    metrics.reference(3.0, 1.25)
    metrics.reference_refused(AlarmId.REFERENCE_BAD)
    metrics.refused(Refusal.BUSY)
    metrics.unexpected()
    metrics.heard("camera")
    metrics.alarms([("disk_full", "high"), ("camera_lost", "medium")])
    metrics.waiting(3)
    metrics.restarted("plc")
    metrics.ready(ready=True)
    status = Status(9, {"disk_full": 2}, 1, 2, {"kept": 5, "dropped": 1}, 1000, 2000, 3000, 0.5, None)
    metrics.watch_records(lambda: status)
    metrics.watch_calibration(lambda: (86_400.0, 60.0, -0.02))
    metrics.watch_backup(lambda: 1_782_790_452.0)
    destination = DestinationStatus(connected=False, told=7, refused=1, waiting=12, oldest_utc_ms=5, error=None)
    metrics.watch_outbox(lambda: OutboxStatus(utc_ms=9, destinations={"postgresql": destination}))


def test_everything_in_the_table_is_exposed_and_nothing_else(metrics, outcome):
    record_everything(metrics, outcome)
    families = {family.name: family for family in parse(metrics.exposition()[0].decode())}
    own = {name for name in families if name.startswith("station_")}
    wanted = {row.name + ("_info" if row.kind == "info" else "") for row in TABLE.values()}
    assert own == wanted
    for row in TABLE.values():
        family = families[row.name + ("_info" if row.kind == "info" else "")]
        assert family.type == {"info": "gauge"}.get(row.kind, row.kind)
        assert family.documentation == row.help
        for sample in family.samples:
            assert set(sample.labels) - {"le"} == set(row.labels)
    assert "process_cpu_seconds" in families


def test_openmetrics_is_served_to_those_who_ask_for_it(metrics, outcome):
    record_everything(metrics, outcome)
    content, content_type = metrics.exposition("application/openmetrics-text; version=1.0.0")
    assert content_type.startswith("application/openmetrics-text")
    assert len(list(parse_openmetrics(content.decode()))) > len(TABLE)


@pytest.mark.parametrize("row", TABLE.values(), ids=TABLE)
def test_names_follow_the_conventions(row):
    name = row.name
    assert name.startswith("station_")
    assert name == name.lower()
    assert not name.endswith(("_total", "_count", "_sum", "_bucket", "_ms", "_seconds_total"))
    assert row.help
    assert not row.help.endswith(".")
    assert set(row.labels) <= set(LABELS), "every label is bounded"
    assert not {"lot", "operator", "sequence", "trigger_id"} & set(row.labels)
    if row.kind == "histogram" and row.buckets:
        assert list(row.buckets) == sorted(set(row.buckets))


def test_a_fruit_that_the_station_lost_has_no_duration(metrics, outcome):
    metrics.inspection("strawberry", outcome.model_copy(update={"duration_ms": 0}))
    found = scraped(metrics)
    assert not [key for key in found if key[0] == "station_inspection_duration_seconds_count"]
    assert [value for key, value in found.items() if key[0] == "station_inspections_total"] == [1]


def test_the_figures_are_those_told(metrics, outcome, clock):
    record_everything(metrics, outcome)
    clock.now_s += 2.0
    found = scraped(metrics)
    inspections = {key[1:]: value for key, value in found.items() if key[0] == "station_inspections_total"}
    assert inspections == {
        (("fruit", "strawberry"), ("outcome", "PASS"), ("reason", "none")): 1,
        (("fruit", "strawberry"), ("outcome", "FAIL"), ("reason", "area_over_limit")): 1,
        (("fruit", "none"), ("outcome", "NO_RESULT"), ("reason", "late")): 1,
    }
    assert found["station_inspections_late_total", ("fruit", "none")] == 1
    fruit = ("fruit", "strawberry")
    assert found["station_contact_area_mm2_sum", fruit] == 63.0
    assert found["station_inspection_duration_seconds_sum", fruit] == pytest.approx(6.42)
    assert found["station_inspection_duration_seconds_bucket", fruit, ("le", "3.2")] == 0
    assert found["station_inspection_duration_seconds_bucket", fruit, ("le", "4.0")] == 2
    assert {key[2][1] for key in found if key[0] == "station_inspection_duration_seconds_bucket"} >= {
        "7.6",
        "8.0",
        "8.4",
    }
    assert found["station_inspections_late_total", fruit] == 0
    assert found["station_inspection_deadline_seconds", fruit] == 9.5
    assert found["station_references_refused_total", ("id", "reference_bad")] == 1
    assert found["station_frames_total", ("state", "torn")] == 2
    assert found["station_link_age_seconds", ("link", "camera")] == 2.0
    assert found[("station_reference_age_seconds",)] == 5.0
    assert found["station_records_images_total", ("result", "kept")] == 5
    assert found["station_records_failures_total", ("code", "disk_full")] == 2
    assert found["station_alarms_active", ("id", "disk_full"), ("priority", "high")] == 1
    metrics.alarms([("camera_lost", "medium")])
    assert scraped(metrics)["station_alarms_active", ("id", "disk_full"), ("priority", "high")] == 0


def test_what_is_not_known_is_absent_and_not_nought(metrics):
    found = scraped(metrics)
    assert ("station_reference_age_seconds",) not in found
    assert not [key for key in found if key[0] == "station_link_age_seconds"]
    metrics.watch_records(lambda: Status(0, {}, 0, 0, {}, 0, 0, 0, None, None))
    assert ("station_records_last_write_age_seconds",) not in scraped(metrics)


def test_another_system_that_was_never_reached_is_behind_since_the_start(metrics):
    now_ms = time.time_ns() // 1_000_000

    def lag_s(**values):
        usual = {"connected": False, "told": 0, "refused": 0, "waiting": None, "oldest_utc_ms": None, "error": None}
        destination = DestinationStatus(**dict[str, Any]({**usual, **values}))
        metrics.watch_outbox(lambda: OutboxStatus(utc_ms=now_ms, destinations={"postgresql": destination}))
        return scraped(metrics)["station_outbox_lag_seconds", ("destination", "postgresql")]

    assert lag_s(away_since_utc_ms=now_ms - 90_000) == pytest.approx(90, abs=30)
    assert lag_s(waiting=0, away_since_utc_ms=now_ms - 90_000) == 0, "away, and nothing waits"
    assert lag_s(waiting=3, oldest_utc_ms=now_ms - 180_000, away_since_utc_ms=now_ms - 90_000) > 170


def test_an_outbox_that_was_heard_before_the_clock_was_set_back_is_not_heard_now(metrics):
    status = OutboxStatus(utc_ms=time.time_ns() // 1_000_000 + 3_600_000, destinations={})
    metrics.watch_outbox(lambda: status)
    assert scraped(metrics)["station_outbox_heard_age_seconds",] > 3000


def test_a_link_that_is_never_heard_has_an_age_from_the_start(metrics, clock):
    metrics.heard("plc")
    clock.now_s += 3.0
    metrics.expect(["plc", "camera"])
    clock.now_s += 40.0
    found = scraped(metrics)
    assert found["station_link_age_seconds", ("link", "camera")] == 40.0
    assert found["station_link_age_seconds", ("link", "plc")] == 43.0


def test_what_may_be_counted_is_there_before_it_happens(metrics):
    metrics.watch_records(lambda: Status(0, {"disk_full": 2}, 0, 0, {}, 0, 0, 0, None, None))
    found = scraped(metrics)
    for alarm, row in ALARMS.items():
        assert found["station_alarms_active", ("id", alarm), ("priority", row.priority)] == 0
    assert found["station_frames_total", ("state", "good")] == found["station_frames_total", ("state", "torn")] == 0
    assert found["station_triggers_refused_total", ("reason", "busy")] == 0
    assert found["station_process_restarts_total", ("process", "plc")] == 0
    assert found["station_references_refused_total", ("id", "reference_bad")] == 0
    assert found["station_records_failures_total", ("code", "locked")] == 0
    assert found["station_records_failures_total", ("code", "disk_full")] == 2
    assert found["station_records_images_total", ("result", "kept")] == 0


def test_no_value_makes_the_number_of_series_grow(metrics, outcome):
    for number in range(300):
        metrics.inspection(f"fruit-{number}", outcome)
        metrics.refused(f"because {number}")
        metrics.heard(f"link-{number}")
        metrics.alarms([(f"alarm-{number}", "high")])
    found = scraped(metrics)
    fruits = [key for key in found if key[0] == "station_inspections_total"]
    assert len(fruits) == 65
    assert found["station_inspections_total", ("fruit", "other"), ("outcome", "PASS"), ("reason", "none")] == 236
    assert found["station_triggers_refused_total", ("reason", "other")] == 300
    assert len([key for key in found if key[0] == "station_link_age_seconds"]) == 17
    assert len([key for key in found if key[0] == "station_alarms_active"]) == 129


def test_the_counts_equal_the_records(metrics, scenario, tmp_path, outcome):
    async def steps():
        settings = RecordsSettings(deadline_s=20.0, free_reserve_mb=1)
        records = await Records.open(tmp_path, settings, "boot")
        metrics.watch_records(records.status)
        fields: dict[str, Any] = {
            key: value for key, value in outcome.model_dump().items() if key in InspectionRecord.__slots__
        }
        for number in range(6):
            sequence = await records.begin(Trigger(number + 1, 0, "", 5, None, simulated=True))
            reasons = ("no_contact",) if number % 3 else ()
            judged: dict[str, Any] = {
                "outcome": "NO_RESULT" if reasons else "PASS",
                "reasons": reasons,
                "explanation": (),
            }
            record = InspectionRecord(**(fields | judged))
            concluded = await records.conclude(sequence, record)
            for _ in range(2):
                if await records.published(concluded):
                    metrics.inspection("", concluded)
        with reading(tmp_path) as connection:
            rows = find_page(connection, Query()).rows
        totals = Counter((row.fruit or "none", row.outcome, (*row.reasons, "none")[0]) for row in rows)
        found = scraped(metrics)
        assert {
            (dict(key[1:])["fruit"], dict(key[1:])["outcome"], dict(key[1:])["reason"]): value
            for key, value in found.items()
            if key[0] == "station_inspections_total"
        } == totals
        assert sum(totals.values()) == 6
        assert found[("station_records_writes_total",)] == records.status().writes > 0
        assert found["station_records_bytes", ("kind", "database")] > 4096
        await records.close()

    scenario(steps)


def test_the_document_has_the_table():
    assert metrics_table.markdown() in DOCUMENT.read_text(encoding="utf-8")
    assert all(f"`{exposed_name(row)}`" in metrics_table.markdown() for row in TABLE.values())
