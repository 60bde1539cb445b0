"""Rules over a history: what would have been recorded, and which alerts would have fired when."""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import yaml

from .month import Plan, Samples, load, series_name
from .prometheus import RULES, Prometheus, Series, running, shipped_alerts, write_configuration

_UNITS_S = {"s": 1, "m": 60, "h": 3600, "d": 86_400}
_POINTS = 10_000
"""Fewer than the 11,000 that Prometheus answers at once."""


class FiredAlert(NamedTuple):
    """One alert as a person would have got it."""

    alert: str
    labels: dict[str, str]
    begin_s: float
    """Seconds since 1970, likewise the end."""
    end_s: float


def record(plan: Plan, folder: Path) -> None:
    """Evaluate the recorded series over the history, group after group as they depend on each other, and keep them.

    Args:
        plan: of the history.
        folder: Prometheus' folder, with `data` in it.
    """
    configuration = write_configuration(folder, "1m", {})
    for group in yaml.safe_load((RULES / "recording.yml").read_text(encoding="utf-8"))["groups"]:
        for rules in _levels(group["rules"]):
            samples: Samples = defaultdict(lambda: defaultdict(list))
            with running(folder, configuration, *NO_COMPACTION) as prometheus:
                for rule in rules:
                    for series in over(prometheus, rule["expr"], plan):
                        name = series_name(rule["record"], sorted(series.labels.items()))
                        lines = [f"{value:.9g} {at_s:.0f}" for at_s, value in series.points]
                        samples[rule["record"], "gauge"][name] = lines
            load(samples, folder / "data")


def over(prometheus: Prometheus, expr: str, plan: Plan) -> list[Series]:
    """An expression over the whole history, at each of its samples' times.

    Args:
        prometheus: that has it.
        expr: PromQL.
        plan: of the history.
    """
    found: dict[tuple[tuple[str, str], ...], list[tuple[float, float]]] = defaultdict(list)
    step_s = plan.step_s
    for begin_s in range(plan.begin_s, plan.end_s + 1, _POINTS * step_s):
        end_s = min(plan.end_s, begin_s + (_POINTS - 1) * step_s)
        for series in prometheus.over(expr, begin_s, end_s, step_s):
            labels = {key: value for key, value in series.labels.items() if key != "__name__"}
            found[tuple(sorted(labels.items()))] += series.points
    return [Series(dict(labels), points) for labels, points in found.items()]


def fired_alerts(prometheus: Prometheus, plan: Plan) -> list[FiredAlert]:
    """Every alert that would have fired, the Watchdog aside, in the order of time.

    Args:
        prometheus: with the history and the recorded series.
        plan: of the history.
    """
    found = [
        FiredAlert(name, series.labels, begin_s, end_s)
        for name, rule in shipped_alerts().items()
        if name != "Watchdog"
        for series in over(prometheus, rule["expr"], plan)
        for begin_s, end_s in episodes(
            [at_s for at_s, _ in series.points],
            plan.step_s,
            seconds(rule.get("for", "0s")),
            seconds(rule.get("keep_firing_for", "0s")),
        )
    ]
    return sorted(found, key=lambda each: (each.begin_s, each.alert))


def episodes(true_s: list[float], step_s: float, for_s: float, keep_s: float) -> Iterator[tuple[float, float]]:
    """When an alert fires whose expression is true at these times, as Prometheus' `for` and `keep_firing_for` have it.

    Args:
        true_s: in order; a time that is missing between two steps is false.
        step_s: between two evaluations.
        for_s: how long it has to be true without a gap.
        keep_s: how long it fires on; what becomes true again meanwhile goes on.
    """
    firing: tuple[float, float] | None = None
    since_s = last_s = float("-inf")
    for at_s in true_s:
        if at_s - last_s > 1.5 * step_s:
            since_s = at_s
        if firing is not None and at_s - firing[1] > max(1.5 * step_s, keep_s):
            yield firing[0], firing[1] + keep_s
            firing = None
        if firing is not None:
            firing = firing[0], at_s
        elif at_s - since_s >= for_s:
            firing = at_s, at_s
        last_s = at_s
    if firing is not None:
        yield firing[0], firing[1] + keep_s


def seconds(duration: str) -> float:
    """A duration with one unit, as rules write it.

    Args:
        duration: as 15m.
    """
    return float(duration[:-1]) * _UNITS_S[duration[-1]]


NO_COMPACTION = (
    "--storage.tsdb.min-block-duration=1d",
    "--storage.tsdb.max-block-duration=1d",
    "--storage.tsdb.retention.time=10y",
)


def _levels(rules: list[dict[str, str]]) -> Iterator[list[dict[str, str]]]:
    """The rules of a group, apart where one uses another that is recorded before it."""
    level: list[dict[str, str]] = []
    for rule in rules:
        if any(other["record"] in rule["expr"] for other in level):
            yield level
            level = []
        level.append(rule)
    yield level
