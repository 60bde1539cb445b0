"""Metrics of the station, in a registry of their own.

Counters begin at 0 with each start of the station, as Prometheus expects; lasting figures are in the records. An
inspection is counted once, when the PLC gets its outcome, so that the counts of one start equal its records'.
"""

import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    Info,
    ProcessCollector,
    disable_created_metrics,
)
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.exposition import choose_encoder
from prometheus_client.registry import Collector

from station.channel.line import Outcome
from station.clock import utc_ms
from station.inspection.alarm_table import ALARMS
from station.outbox.status import OutboxStatus
from station.records.records import Status
from station.runtime.observability.metrics_table import LABELS, OTHER, TABLE, Row

DEADLINE_SHARES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1.0, 1.05, 1.1, 1.25, 1.5, 2.0)


class Metrics(Collector):
    """Counters and gauges of the station; every method is fast and never raises for a value."""

    def __init__(self, version: str, deadline_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        """Register everything in the table; one inspection's deadline is the centre of the durations' buckets."""
        disable_created_metrics()  # an extra series for each counter, which is not needed
        self.registry = CollectorRegistry(auto_describe=False)
        ProcessCollector(registry=self.registry)
        self._clock = clock
        self._values: dict[str, set[str]] = {}
        self._heard_s: dict[str, float] = {}
        self._active: set[tuple[str, str]] = {(alarm, row.priority) for alarm, row in ALARMS.items()}
        self._reference: tuple[float, float] | None = None
        self._status: Callable[[], Status] | None = None
        self._figures: Callable[[], Sequence[float | None]] | None = None
        self._backup: Callable[[], float] | None = None
        self._outbox: Callable[[], OutboxStatus | None] = lambda: None
        buckets = tuple(round(share * deadline_s, 6) for share in DEADLINE_SHARES)
        self._made: dict[str, Any] = {
            key: _made(row, buckets, self.registry) for key, row in TABLE.items() if not row.at_scrape
        }
        for key, row in TABLE.items():
            for values in () if row.at_scrape else row.known:
                self._of(key, **dict(zip(row.labels, values, strict=True)))
        self.registry.register(self)
        self._made["build"].info(
            {"version": self._label("version", version), "python": self._label("python", platform.python_version())}
        )

    def inspection(
        self,
        fruit: str,
        outcome: Outcome,
        phases_s: Mapping[str, float] | None = None,
        deadline_s: float | None = None,
    ) -> None:
        """Count one inspection, when `Records.published` first reports it, with its deadline where it is known."""
        fruit = fruit or "none"
        reason = outcome.reasons[0] if outcome.reasons else "none"
        self._of("inspections", fruit=fruit, outcome=outcome.outcome, reason=reason).inc()
        if outcome.duration_ms:  # not known of a fruit that the station lost
            self._of("duration", fruit=fruit).observe(outcome.duration_ms / 1000)
        self._of("late", fruit=fruit).inc(outcome.late)
        self._of("second_presses", fruit=fruit).inc(0)  # a rate needs the count from before the first
        if deadline_s is not None:
            self._of("deadline", fruit=fruit).set(deadline_s)
        if outcome.area_mm2 is not None:
            self._of("area", fruit=fruit).observe(outcome.area_mm2)
        if outcome.closing_mm is not None:
            self._of("closing", fruit=fruit).observe(outcome.closing_mm)
        for phase, seconds in (phases_s or {}).items():
            self._of("phase", phase=phase).observe(seconds)

    def pressed_again(self, fruit: str) -> None:
        """Count a fruit that is pressed once more, by the recipe's name."""
        self._of("second_presses", fruit=fruit).inc()

    def frame(self, state: str, number: int = 1) -> None:
        """Count frames of one state: `good`, or a `FrameFault`."""
        self._of("frames", state=state).inc(number)

    def reference(self, age_s: float, drift_grey_levels: float) -> None:
        """Set the age of the reference in use, which grows from now on, and its distance from the golden one."""
        self._reference = (self._clock() - age_s, drift_grey_levels)

    def reference_refused(self, alarm: str) -> None:
        """Count a picture of the untouched gel that was refused as reference, by its alarm."""
        self._of("references_refused", id=alarm).inc()

    def refused(self, reason: str) -> None:
        """Count a trigger that was not accepted, by its `Refusal`."""
        self._of("refused", reason=reason).inc()

    def unexpected(self) -> None:
        """Count an event that the cycle's table does not list."""
        self._of("unexpected").inc()

    def heard(self, link: str) -> None:
        """Note a sign of life of a device, process or heartbeat; its age is exported from now on."""
        self._heard_s[self._label("link", link)] = self._clock()

    def expect(self, links: Iterable[str]) -> None:
        """Export the ages of links from now on, also of those never heard: a start must not hide a lost one."""
        for link in links:
            self._heard_s.setdefault(self._label("link", link), self._clock())

    def alarms(self, active: Iterable[tuple[str, str]]) -> None:
        """Export these alarms, as id and priority, and no other, as active."""
        shown = {(self._label("id", name), self._label("priority", priority)) for name, priority in active}
        self._active |= shown
        for name, priority in self._active:
            self._made["alarms"].labels(name, priority).set((name, priority) in shown)

    def waiting(self, outcomes: int) -> None:
        """Set how many outcomes the PLC has not acknowledged."""
        self._of("waiting").set(outcomes)

    def restarted(self, process: str) -> None:
        """Count a restart of a process."""
        self._of("restarts", process=process).inc()

    def ready(self, *, ready: bool) -> None:
        """Set whether a trigger would be accepted."""
        self._of("ready").set(ready)

    def watch_records(self, status: Callable[[], Status]) -> None:
        """Read the records' state at each scrape: `Records.status`."""
        self._status = status

    def watch_calibration(self, figures: Callable[[], Sequence[float | None]]) -> None:
        """Read at each scrape the ages of calibration and verification, and the drift: `ActiveCalibration.figures`."""
        self._figures = figures

    def watch_backup(self, last_utc_s: Callable[[], float]) -> None:
        """Read the time of the last backup at each scrape."""
        self._backup = last_utc_s

    def watch_outbox(self, status: Callable[[], OutboxStatus | None]) -> None:
        """Read the outbox's state at each scrape."""
        self._outbox = status

    def exposition(self, accept: str = "") -> tuple[bytes, str]:
        """Return all metrics, and the content type, for an `Accept` header; empty for Prometheus' text format."""
        encode, content_type = choose_encoder(accept)
        return encode(self.registry), content_type

    def _of(self, key: str, **labels: str) -> Any:
        metric = self._made[key]
        return metric.labels(**{name: self._label(name, value) for name, value in labels.items()}) if labels else metric

    def _label(self, name: str, value: str) -> str:
        """Return the value if the label may have it, else `other`: no caller can make the number of series grow."""
        allowed = LABELS[name]
        if isinstance(allowed, frozenset):
            return value if value in allowed else OTHER
        taken = self._values.setdefault(name, set())
        if value not in taken and len(taken) >= allowed:
            return OTHER
        taken.add(value)
        return value

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics that are read at the scrape."""
        now_s = self._clock()
        ages = GaugeMetricFamily(TABLE["link_age"].name, TABLE["link_age"].help, labels=["link"])
        for link, heard_s in tuple(self._heard_s.items()):
            ages.add_metric([link], now_s - heard_s)
        yield ages
        if self._reference is not None:
            taken_s, drift_grey_levels = self._reference
            yield GaugeMetricFamily(TABLE["reference_age"].name, TABLE["reference_age"].help, now_s - taken_s)
            yield GaugeMetricFamily(TABLE["reference_drift"].name, TABLE["reference_drift"].help, drift_grey_levels)
        if self._figures is not None:
            shown = zip(("calibration_age", "verification_age", "calibration_drift"), self._figures(), strict=True)
            for key, value in shown:
                if value is not None:
                    yield GaugeMetricFamily(TABLE[key].name, TABLE[key].help, value)
        if self._status is not None:
            yield from _of_records(self._status())
        if self._backup is not None:
            yield GaugeMetricFamily(TABLE["backup_timestamp"].name, TABLE["backup_timestamp"].help, self._backup())
        if (status := self._outbox()) is not None:
            yield from _of_outbox(status)


def _made(row: Row, around_deadline: tuple[float, ...], registry: CollectorRegistry) -> Any:
    """Make the prometheus-client metric of a row."""
    match row.kind:
        case "counter":
            return Counter(row.name, row.help, row.labels, registry=registry)
        case "gauge":
            return Gauge(row.name, row.help, row.labels, registry=registry)
        case "histogram":
            return Histogram(row.name, row.help, row.labels, registry=registry, buckets=row.buckets or around_deadline)
        case "info":
            return Info(row.name, row.help, registry=registry)


Values = Mapping[str, Mapping[tuple[str, ...], float | None]]
"""By the table's key and the labels; None is absent."""


def _of_records(status: Status) -> Iterator[Metric]:
    """Yield the records' metrics."""
    gauges: Values = {
        "records_queue": {(): status.queue},
        "records_images_queue": {(): status.images_waiting},
        "records_bytes": {("database",): status.database_bytes, ("images",): status.image_bytes},
        "records_free": {(): status.free_bytes},
        "records_write_age": {(): status.last_write_age_s},
    }
    counters: Values = {
        "records_writes": {(): status.writes},
        "records_failures": {(code,): number for code, number in status.failures.items()},
        "records_images": {(result,): number for result, number in status.images.items()},
    }
    yield from _families(gauges, counters)


def _of_outbox(status: OutboxStatus) -> Iterator[Metric]:
    """Yield the outbox's metrics."""
    now_utc_ms = utc_ms()
    destinations = status.destinations.items()

    def age_s(utc_ms: int | None) -> float:
        return 0.0 if utc_ms is None else max(0.0, (now_utc_ms - utc_ms) / 1000)

    gauges: Values = {
        "outbox_connected": {(name,): each.connected for name, each in destinations},
        "outbox_waiting": {(name,): each.waiting for name, each in destinations},
        "outbox_lag": {(name,): age_s(each.waiting_since_utc_ms) for name, each in destinations},
        "outbox_age": {(): status.age_s},
    }
    yield from _families(gauges, {"outbox_refused": {(name,): each.refused for name, each in destinations}})


def _families(gauges: Values, counters: Values) -> Iterator[Metric]:
    for kind, families in ((GaugeMetricFamily, gauges), (CounterMetricFamily, counters)):
        for key, values in families.items():
            family = kind(TABLE[key].name, TABLE[key].help, labels=TABLE[key].labels)
            known: Mapping[tuple[str, ...], float | None] = dict.fromkeys(TABLE[key].known, 0.0)
            for labels, value in {**known, **values}.items():
                if value is not None:
                    family.add_metric(labels, value)
            yield family
