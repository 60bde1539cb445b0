"""Table of all metrics: the source of the code, the document and the test.

Names follow Prometheus' conventions ("Metric and label naming", prometheus.io/docs/practices/naming): seconds and
bytes as base units, `_total` for counters. Lengths and areas are in mm and mm², as everywhere in the station.
"""

from typing import Literal, NamedTuple

from station.devices.camera.interface import FrameFault
from station.inspection.alarm_table import ALARMS
from station.press.reference import ALARMS as REFERENCE_ALARMS
from station.records.errors import RecordsDeadlineError
from station.records.writer import CONCERNING_ALL
from station.vocabulary import Reason, Refusal

OTHER = "other"
"""Label value for a value that is not one of its own, or one too many."""

LABELS: dict[str, frozenset[str] | int] = {
    "fruit": 64,
    "outcome": frozenset({"PASS", "FAIL", "NO_RESULT"}),
    "reason": frozenset({"none", *Reason, *Refusal}),
    "phase": 32,
    "state": 16,
    "link": 16,
    "id": 128,
    "priority": 8,
    "process": 16,
    "kind": frozenset({"database", "images"}),
    "code": 16,
    "result": frozenset({"kept", "dropped", "failed", "removed", "over_quota"}),
    "destination": frozenset({"postgresql", "mqtt"}),
    "version": 1,
    "python": 1,
}
"""Values of each label: these, or at most so many different ones; all others become `other`."""


class Row(NamedTuple):
    """One metric."""

    name: str
    """Without the `_total` of a counter."""
    kind: Literal["counter", "gauge", "histogram", "info"]
    labels: tuple[str, ...]
    help: str
    buckets: tuple[float, ...] = ()
    """A histogram's upper bounds; empty if they follow the inspection's deadline."""
    at_scrape: bool = False
    """Read at the scrape instead of being set."""
    known: tuple[tuple[str, ...], ...] = ()
    """Label values exported from the start, at 0: a series that begins with its first event has no increase then."""


_MM2 = (1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0, 65.0, 80.0, 100.0, 130.0, 160.0, 200.0, 260.0)
_MM = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 20.0)
_PHASE_S = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)

_FAILURES = tuple((error.code,) for error in (*CONCERNING_ALL, RecordsDeadlineError))

TABLE: dict[str, Row] = {
    "inspections": Row(
        "station_inspections",
        "counter",
        ("fruit", "outcome", "reason"),
        "Inspections whose outcome the PLC was given, by the first reason; none where passed",
    ),
    "second_presses": Row(
        "station_second_presses", "counter", ("fruit",), "Fruit that one press did not decide, pressed once more"
    ),
    "late": Row("station_inspections_late", "counter", ("fruit",), "Inspections that ended after their deadline"),
    "deadline": Row(
        "station_inspection_deadline_seconds", "gauge", ("fruit",), "Longest that its last inspection might take"
    ),
    "duration": Row(
        "station_inspection_duration_seconds",
        "histogram",
        ("fruit",),
        "From trigger to durable outcome, where it is known; the buckets are shares of the inspection's deadline",
    ),
    "phase": Row(
        "station_phase_duration_seconds", "histogram", ("phase",), "Time spent in one phase of the cycle", _PHASE_S
    ),
    "area": Row("station_contact_area_mm2", "histogram", ("fruit",), "Contact area that decided", _MM2),
    "closing": Row("station_closing_mm", "histogram", ("fruit",), "Closing at which the area decided", _MM),
    "frames": Row(
        "station_frames",
        "counter",
        ("state",),
        "Frames by what is wrong with them; good where nothing",
        known=tuple((state,) for state in ("good", *FrameFault)),
    ),
    "references_refused": Row(
        "station_references_refused",
        "counter",
        ("id",),
        "Refused reference images of the untouched gel, by alarm",
        known=tuple((alarm,) for alarm in REFERENCE_ALARMS),
    ),
    "reference_age": Row("station_reference_age_seconds", "gauge", (), "Age of the reference in use", at_scrape=True),
    "reference_drift": Row(
        "station_reference_drift_grey_levels",
        "gauge",
        (),
        "Difference of the reference from the golden reference",
        at_scrape=True,
    ),
    "calibration_age": Row(
        "station_calibration_age_seconds",
        "gauge",
        (),
        "Age of the sensor's calibration",
        at_scrape=True,
    ),
    "verification_age": Row(
        "station_verification_age_seconds", "gauge", (), "Time since the last verification against it", at_scrape=True
    ),
    "calibration_drift": Row(
        "station_calibration_drift_ratio",
        "gauge",
        (),
        "Relative change of the ball's area since the calibration, by the last verification",
        at_scrape=True,
    ),
    "refused": Row(
        "station_triggers_refused",
        "counter",
        ("reason",),
        "Triggers that were not accepted",
        known=tuple((refusal,) for refusal in Refusal),
    ),
    "unexpected": Row("station_unexpected_events", "counter", (), "Events that the cycle's table does not list"),
    "link_age": Row(
        "station_link_age_seconds",
        "gauge",
        ("link",),
        "Time since a device, process or heartbeat was last heard, or since the station's start",
        at_scrape=True,
    ),
    "alarms": Row(
        "station_alarms_active",
        "gauge",
        ("id", "priority"),
        "1 while an alarm's cause is there",
        known=tuple((alarm, row.priority) for alarm, row in ALARMS.items()),
    ),
    "waiting": Row("station_outcomes_waiting", "gauge", (), "Outcomes that the PLC has not acknowledged"),
    "restarts": Row(
        "station_process_restarts",
        "counter",
        ("process",),
        "Times a process was started again",
        known=tuple((process,) for process in ("service", "plc", "hmi", "outbox")),
    ),
    "ready": Row("station_ready", "gauge", (), "1 while a trigger would be accepted"),
    "build": Row("station_build", "info", ("version", "python"), "What runs"),
    "records_writes": Row("station_records_writes", "counter", (), "Transactions made durable", at_scrape=True),
    "records_failures": Row(
        "station_records_failures",
        "counter",
        ("code",),
        "Requests to the records that failed",
        at_scrape=True,
        known=_FAILURES,
    ),
    "records_queue": Row("station_records_queue", "gauge", (), "Requests that wait for the database", at_scrape=True),
    "records_images_queue": Row(
        "station_records_images_queue", "gauge", (), "Inspections whose images wait for the disk", at_scrape=True
    ),
    "records_bytes": Row("station_records_bytes", "gauge", ("kind",), "Space that the records take", at_scrape=True),
    "records_free": Row("station_records_free_bytes", "gauge", (), "Space left on the records' disk", at_scrape=True),
    "records_images": Row(
        "station_records_images",
        "counter",
        ("result",),
        "Images by what became of them",
        at_scrape=True,
        known=(("kept",), ("dropped",), ("failed",), ("removed",), ("over_quota",)),
    ),
    "backup_timestamp": Row(
        "station_backup_timestamp_seconds",
        "gauge",
        (),
        "Time of the last complete backup, since 1970; 0 before the first",
        at_scrape=True,
    ),
    "outbox_connected": Row(
        "station_outbox_connected", "gauge", ("destination",), "1 while another system is connected", at_scrape=True
    ),
    "outbox_waiting": Row(
        "station_outbox_waiting",
        "gauge",
        ("destination",),
        "Entries not yet sent to another system; absent while unknown",
        at_scrape=True,
    ),
    "outbox_lag": Row(
        "station_outbox_lag_seconds",
        "gauge",
        ("destination",),
        "Time since the first of them was made, by the machine's clock; 0 where none waits; while unknown, the time "
        "since the other system was lost",
        at_scrape=True,
    ),
    "outbox_refused": Row(
        "station_outbox_refused",
        "counter",
        ("destination",),
        "Events that another system did not take as they are, since the outbox began",
        at_scrape=True,
    ),
    "outbox_age": Row(
        "station_outbox_heard_age_seconds", "gauge", (), "Time since the outbox's process was heard", at_scrape=True
    ),
    "records_write_age": Row(
        "station_records_last_write_age_seconds",
        "gauge",
        (),
        "Time since the last transaction; absent before it",
        at_scrape=True,
    ),
}


def exposed_name(row: Row) -> str:
    """Return the name as it is scraped."""
    return row.name + {"counter": "_total", "info": "_info"}.get(row.kind, "")


def markdown() -> str:
    """Return the table of docs/metrics.md."""
    head = "| metric | type | labels | is |\n| --- | --- | --- | --- |\n"
    rows = [
        f"| `{exposed_name(row)}` | {row.kind} | {', '.join(f'`{label}`' for label in row.labels)} | {row.help} |\n"
        for row in TABLE.values()
    ]
    return head + "".join(rows)
