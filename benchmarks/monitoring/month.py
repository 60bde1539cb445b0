"""A line's history that never was: given to the station's own `Metrics` fruit by fruit, sampled as Prometheus would.

What is named and labelled is therefore what the station names and labels. The line works from 6 to 22 h, lots take two
hours, and each grower's fruit is a little better or worse than another's. Things that are no trouble happen too: the
light warms up every morning, the service is started anew once a week, the network is away for half an hour.
"""

import math
import random
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from prometheus_client.core import Metric

from station.channel.line import Outcome
from station.outbox.status import DestinationStatus, OutboxStatus
from station.records.records import Status
from station.runtime.observability.metrics import Metrics
from station.vocabulary import Reason

from .prometheus import promtool

STATION = "station-1"
HOUR_S, DAY_S = 3600, 86_400
FRUIT_A_MINUTE = 6
_KINDS = (("strawberry", 12), ("raspberry", 17), ("blueberry", 22))
"""Until which hour of the day."""
_FIRST_H, _LOT_H = 6, 2
_USUAL_REJECTS = 0.06
_UNJUDGED = (Reason.LOW_CONFIDENCE, Reason.NO_CONTACT, Reason.CUT_BY_BORDER)
_DEADLINE_S = 12.0
_AREAS_MM2 = {"strawberry": 45.0, "raspberry": 28.0, "blueberry": 20.0}
_FRAMES = 30
LINKS = ("arm", "camera", "gripper", "plc", "plc_interface")
PHASES = {"approaching": 0.9, "closing_to_onset": 1.6, "moving_measuring": 1.2, "judging": 0.01}
"""Of the cycle, s; some of them."""
_MOST_DRIFT, _HALFWAY = 25.0, 12.5


class Trouble(NamedTuple):
    """Something that is wrong for a time."""

    kind: str
    """`bad lot`, `torn gel` or `dying LED`."""
    begin_s: float
    end_s: float
    """From the history's begin; then the lot is through, the gel or the sensor is changed."""
    alerts: tuple[str, ...]
    """The alerts that have to fire, and no others."""


def troubles(*days: int) -> tuple[Trouble, ...]:
    """One of each.

    Args:
        days: on which the bad lot comes, the gel tears and the LED begins to fade, from 0.
    """
    lot, gel, led = (day * DAY_S for day in days)
    return (
        Trouble("bad lot", lot + 8 * HOUR_S, lot + 10 * HOUR_S, ("RejectRateHigh",)),
        Trouble("torn gel", gel + 14 * HOUR_S, gel + 15 * HOUR_S, ("GelTorn",)),
        Trouble("dying LED", led + 7 * HOUR_S, led + 34 * HOUR_S, ("ReferenceDrifting", "SensorLightDead")),
    )


@dataclass(frozen=True, slots=True)
class Plan:
    """Plan of the simulation: its days, the time between samples, and the troubles."""

    begin_s: int
    """Midnight of the first day, UTC, seconds since 1970."""
    days: int
    step_s: int
    """Between two samples; below Prometheus' lookback of 5 minutes."""
    troubles: tuple[Trouble, ...] = ()
    seed: int = 1

    @property
    def end_s(self) -> int:
        """The last sample's time."""
        return self.begin_s + self.days * DAY_S - self.step_s


Samples = dict[tuple[str, str], dict[str, list[str]]]
"""By family and type, and by series: lines of a value and its time."""


class Line:
    """The line and its station, step by step.

    Args:
        plan: what happens.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan, self._random = plan, random.Random(plan.seed)
        self._now_s = 0.0
        self._calibrated_s, self._verified_s = -20.0 * DAY_S, -3.0 * DAY_S
        self._writes, self._images = 0, 0
        self._lots: dict[int, float] = {}
        self._metrics = self._started()

    def steps(self) -> Iterator[tuple[float, Metrics]]:
        """Each sample's time, seconds since 1970, and the station then."""
        for number in range(self.plan.days * DAY_S // self.plan.step_s):
            self._now_s = number * self.plan.step_s
            if number and self._now_s % (7 * DAY_S) == 3 * HOUR_S:
                self._metrics = self._started()
            self._change()
            self._update_metrics()
            yield self.plan.begin_s + self._now_s, self._metrics

    def _started(self) -> Metrics:
        metrics = Metrics("0.1.0", _DEADLINE_S, clock=lambda: self._now_s)
        metrics.watch_records(self._records)
        metrics.watch_calibration(lambda: (self._now_s - self._calibrated_s, self._now_s - self._verified_s, 0.01))
        metrics.watch_backup(lambda: self.plan.begin_s + self._now_s - (self._now_s - 3.5 * HOUR_S) % DAY_S)
        metrics.watch_outbox(self._outbox)
        metrics.ready(ready=True)
        return metrics

    def _change(self) -> None:
        """Calibrate and verify anew when a trouble has just ended, as a person does; a bad lot needs neither."""
        for trouble in self.plan.troubles:
            if trouble.kind != "bad lot" and 0 <= self._now_s - trouble.end_s < self.plan.step_s:
                self._calibrated_s = self._verified_s = self._now_s

    def _update_metrics(self) -> None:
        metrics, hour = self._metrics, self._now_s % DAY_S / HOUR_S
        for link in LINKS:
            metrics.heard(link)
        refused_by, drift = self._sensor(hour)
        alarms = []
        if refused_by:
            alarms.append((refused_by, "medium"))
        elif drift > _HALFWAY:
            alarms.append(("reference_drifting", "low"))
        metrics.alarms(alarms)
        kind = next((kind for kind, until_h in _KINDS if _FIRST_H <= hour < until_h), None)
        metrics.waiting(0 if kind is None else self._random.randrange(2))
        if kind is None:
            return
        for _ in range(round(FRUIT_A_MINUTE * self.plan.step_s / 60 * self._random.uniform(0.9, 1.1))):
            if refused_by:
                metrics.reference_refused(refused_by)
            else:
                metrics.reference(2.0, drift + self._random.gauss(0, 0.3))
            self._inspect(kind, sensor_fails=bool(refused_by))
        if self._random.random() < 0.02:
            metrics.refused("busy")

    def _sensor(self, hour: float) -> tuple[str, float]:
        """By which alarm references are refused, and how far the light is from the golden reference's."""
        drift = 3.0 + 2.5 * math.sin(math.pi * max(0.0, hour - 6.0) / 16.0)
        for trouble in self.plan.troubles:
            if not trouble.begin_s <= self._now_s < trouble.end_s:
                continue
            if trouble.kind == "torn gel":
                return "reference_bad", drift
            if trouble.kind == "dying LED":
                gone = (self._now_s - trouble.begin_s) / (trouble.end_s - trouble.begin_s)
                drift = max(drift, 5.5 + 21.0 * gone)
        return ("camera_led_dead" if drift > _MOST_DRIFT else ""), drift

    def _inspect(self, kind: str, *, sensor_fails: bool) -> None:
        chance, draw = self._rejects(), self._random.random()
        if sensor_fails:
            outcome, reasons = "NO_RESULT", (Reason.REFERENCE_BAD,)
        elif draw < chance:
            outcome, reasons = "FAIL", (Reason.AREA_OVER_LIMIT,)
        elif draw > 0.97:
            outcome, reasons = "NO_RESULT", (self._random.choice(_UNJUDGED),)
        else:
            outcome, reasons = "PASS", ()
        judged = outcome != "NO_RESULT"
        spread = math.exp(self._random.gauss(0.45 if outcome == "FAIL" else 0.0, 0.2))
        seconds = 6.0 + abs(self._random.gauss(0.0, 0.8))
        concluded = Outcome.model_construct(  # pyrefly: ignore[missing-argument] (what the metrics read)
            outcome=outcome, reasons=reasons, late=self._random.random() < 0.0005, duration_ms=round(1000 * seconds),
            area_mm2=_AREAS_MM2[kind] * spread if judged else None, closing_mm=4.0 * spread if judged else None,
        )  # fmt: skip
        self._metrics.inspection(kind, concluded, PHASES, _DEADLINE_S)
        if not judged:
            self._metrics.pressed_again(kind)
        self._metrics.frame("good", _FRAMES)
        if self._random.random() < 0.01:
            self._metrics.frame("repeated")
        self._writes += 4
        self._images += outcome != "PASS"

    def _rejects(self) -> float:
        """The share of this lot that fails."""
        if any(t.kind == "bad lot" and t.begin_s <= self._now_s < t.end_s for t in self.plan.troubles):
            return 0.3
        lot = int(self._now_s // (_LOT_H * HOUR_S))
        if lot not in self._lots:
            self._lots[lot] = min(0.09, max(0.035, self._random.gauss(_USUAL_REJECTS, 0.015)))
        return self._lots[lot]

    def _records(self) -> Status:
        image_bytes = min(5_000_000_000, 5_000_000 * self._images)
        database_bytes = 20_000 * self._writes // 4
        images = {"kept": self._images, "dropped": 0, "failed": 0, "removed": max(0, self._images - 1000)}
        free = 180_000_000_000 - image_bytes - database_bytes
        return Status(self._writes, {}, 0, 0, images, database_bytes, image_bytes, free, 1.0, None)

    def _outbox(self) -> OutboxStatus:
        """The network is away for half an hour on the second day."""
        away_s = self._now_s - DAY_S - 17 * HOUR_S
        away = 0 <= away_s < HOUR_S / 2
        waiting = round(away_s / 60 * FRUIT_A_MINUTE) if away else self._random.randrange(3)
        now_ms = time.time_ns() // 1_000_000
        oldest = now_ms - round(1000 * (away_s if away else 1.0)) if waiting else None
        destination = DestinationStatus(
            connected=not away, told=0, refused=0, waiting=waiting, oldest_utc_ms=oldest, error=None
        )
        return OutboxStatus(utc_ms=now_ms, destinations={"postgresql": destination})


def write_history(plan: Plan, folder: Path, report: Callable[[str], None] = lambda _: None) -> set[tuple[str, str]]:
    """Simulate, and put the samples into Prometheus' data, a day at a time.

    Args:
        plan: what is simulated.
        folder: of Prometheus' data.
        report: called with the progress after each day.

    Returns:
        The name and the labels of every series.
    """
    line, seen = Line(plan), set()
    samples: Samples = defaultdict(lambda: defaultdict(list))
    for at_s, metrics in line.steps():
        _sample(samples, at_s, metrics.registry.collect())
        if (at_s + plan.step_s - plan.begin_s) % DAY_S == 0:
            seen |= {(family, series) for (family, _), lines in samples.items() for series in lines}
            load(samples, folder)
            samples.clear()
            report(f"day {round((at_s - plan.begin_s) / DAY_S)} of {plan.days}")
    return seen


def load(samples: Samples, folder: Path) -> None:
    """Backfill samples by promtool.

    Args:
        samples: in the order of time within each series.
        folder: of Prometheus' data.
    """
    file = folder.parent / "backfill.txt"
    with file.open("w", encoding="utf-8") as text:
        for (family, kind), lines in samples.items():
            text.write(f"# TYPE {family} {kind}\n")
            for series, values in lines.items():
                text.writelines(f"{series} {value}\n" for value in values)
        text.write("# EOF\n")
    folder.mkdir(exist_ok=True)
    promtool("tsdb", "create-blocks-from", "openmetrics", "--quiet", "--max-block-duration=24h", file, folder)
    file.unlink()


def series_name(name: str, labels: Sequence[tuple[str, str]]) -> str:
    """A series as OpenMetrics writes it.

    Args:
        name: the sample's.
        labels: names and values, without quotes in them.
    """
    return name + "{" + ",".join(f'{key}="{value}"' for key, value in labels) + "}"


def _sample(samples: Samples, at_s: float, families: Iterable[Metric]) -> None:
    ours = (("job", "station"), ("instance", STATION), ("station", STATION))
    for family in families:
        if family.name.startswith("process_"):
            continue
        lines = samples[family.name, family.type]
        for each in family.samples:
            name = series_name(each.name, (*each.labels.items(), *ours))
            lines[name].append(f"{each.value:g} {at_s:.0f}" if each.value % 1 else f"{each.value:.0f} {at_s:.0f}")
    samples["up", "gauge"][series_name("up", ours)].append(f"1 {at_s:.0f}")
