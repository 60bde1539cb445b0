"""Every panel drawn from a demonstration, and a month of a line with a bad lot, a torn gel and a dying LED.

Writes docs/images/monitoring-*.png and the figures in docs/monitoring.md. `--only alerts` renews the alerts' part of
the document alone, which needs nothing; `demo` and `month` one of the two others.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl
from archive import postgres
from matplotlib.dates import ConciseDateFormatter, DayLocator, date2num
from matplotlib.figure import Figure
from monitoring import history, month, prometheus, site
from monitoring.document import DOCUMENT, alerts, with_part
from monitoring.drawing import Answer, Rows, draw
from monitoring.queries import Panel, dashboards, panels, promql, sql

IMAGES = DOCUMENT.parent / "images"
FRUITS = 9
DAYS, STEP_S = 30, 240
BEGIN_S = 1_788_220_800
"""2026-09-01, midnight, UTC."""
BAD_DAYS = (9, 15, 22)
_POINTS = 240


def over_time(panel: Panel) -> bool:
    """Return whether a panel shows values over time, and not at one moment."""
    return panel.data["type"] in {"timeseries", "heatmap"}


def query_target(
    found: prometheus.Prometheus,
    server: Any,
    begin_s: float,
    end_s: float,
    rate: str,
    week: str,
    panel: Panel,
    target: dict[str, Any],
) -> Answer:
    """One target's answer, from the database that it queries."""
    if "rawSql" in target:
        times = (datetime.fromtimestamp(at, UTC).isoformat() for at in (begin_s, end_s))
        text = sql(target["rawSql"], *times, station=[site.STATION], fruit=["blueberry"])
        with server.connect() as connection:
            cursor = connection.execute(text.encode())
            return Rows([column.name for column in cursor.description or ()], cursor.fetchall())
    expr = promql(target["expr"], site.STATION, rate, week)
    if over_time(panel):
        return found.over(expr, begin_s, end_s, max(1.0, (end_s - begin_s) / _POINTS))
    return found.now(expr, end_s)


def of_demonstration() -> None:
    """Run it, and draw all dashboards."""
    programs = postgres.programs()
    if programs is None:
        raise SystemExit("PostgreSQL's programs are missing: apt-get install postgresql")
    with (
        tempfile.TemporaryDirectory() as folder,
        postgres.throwaway(programs) as server,
        site.demonstration(Path(folder), server, FRUITS, "127.89.0.1") as shown,
    ):
        for name, board in dashboards().items():
            query = partial(query_target, shown.prometheus, server, shown.began_s + 10, shown.at_s, "15s", "30s")
            chosen = [panel for panel in panels() if panel.board == name]
            title = f"{board['title']}: {FRUITS} fruits of a demonstration, drawn by the project, not by Grafana"
            draw(board, chosen, query, IMAGES / f"monitoring-{name}.png", title)


def of_month() -> str:
    """Simulate it twice, with and without troubles; draw, and report the alerts that fired."""
    parts = []
    for bad in (True, False):
        plan = month.Plan(BEGIN_S, DAYS, STEP_S, month.troubles(*BAD_DAYS) if bad else ())
        began_s = time.monotonic()
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            month.write_history(plan, folder / "data", lambda day: print(day, file=sys.stderr))
            history.record(plan, folder)
            configuration = prometheus.write_configuration(folder, "1m", {})
            with prometheus.running(folder, configuration, *history.NO_COMPACTION) as found:
                fired = history.fired_alerts(found, plan)
                fruit = found.now("sum(increase(station_inspections_total[30d]))", plan.end_s)[0].points[0][1]
                if bad:
                    draw_month(found, plan, fired)
                    draw_bad_week(found, plan)
        took_s = time.monotonic() - began_s
        parts.append(words(plan, fired, fruit, took_s))
    return "\n".join(parts)


def words(plan: month.Plan, fired: Sequence[history.FiredAlert], fruit: float, took_s: float) -> str:
    """One month in words."""
    head = (
        f"{plan.days} days, about {fruit:,.0f} fruit, a sample every {plan.step_s // 60} minutes, simulated and "
        f"evaluated in {took_s / 60:.1f} minutes: "
    )
    if not plan.troubles:
        return head + f"without troubles, **{len(fired)}** alerts fired.\n"
    lines = ["| what | from | until | alert | fired after | until |", "|---|---|---|---|---|---|"]
    left = list(fired)
    for trouble in plan.troubles:
        begin_s, end_s = plan.begin_s + trouble.begin_s, plan.begin_s + trouble.end_s
        its = [each for each in left if each.alert in trouble.alerts and begin_s <= each.begin_s < end_s]
        for each in its:
            left.remove(each)
            after = (each.begin_s - begin_s) / 60
            lines.append(
                f"| {trouble.kind} | {_at(begin_s)} | {_at(end_s)} | {each.alert} | "
                f"{f'{after:.0f} min' if after < 120 else f'{after / 60:.1f} h'} | {_at(each.end_s)} |"
            )
    others = ", ".join(f"{each.alert} on {_at(each.begin_s)}" for each in left) or "**none**"
    return head + "with three troubles.\n\n" + "\n".join(lines) + f"\n\nOther alerts: {others}.\n"


def draw_month(found: prometheus.Prometheus, plan: month.Plan, fired: Sequence[history.FiredAlert]) -> None:
    """The reject rate with its band, the drift, and the alerts with their times."""
    with mpl.rc_context({"font.size": 9}):
        figure = Figure(figsize=(13, 8), layout="constrained")
        rate, drift, alarm = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 2))
        for name, style in (("1h", "-"), ("highest", ":")):
            for series in history.over(found, f"station_fruit:reject_ratio:{name}", plan):
                times = [_date(at_s) for at_s, _ in series.points]
                color = {"strawberry": "#b3261e", "raspberry": "#7b1fa2", "blueberry": "#1f4e79"}[
                    series.labels["fruit"]
                ]
                label = series.labels["fruit"] + (", highest" if name == "highest" else "")
                values = [100 * value for _, value in series.points]
                rate.plot(
                    times, values, ".", markersize=1.5, color=color, alpha=1.0 if style == "-" else 0.15, label=label
                )
        rate.set_ylabel("rejected in an hour [%]")
        rate.legend(ncols=2, fontsize=7, markerscale=5)
        for series in history.over(found, "station_reference_drift_grey_levels", plan):
            drift.plot([_date(at_s) for at_s, _ in series.points], [value for _, value in series.points], linewidth=0.7)
        drift.axhline(12.5, color="#c55a11", linestyle="--", linewidth=0.8)
        drift.set_ylabel("drift of the reference [grey levels]")
        names = sorted({each.alert for each in fired})
        for each in fired:
            y = names.index(each.alert)
            alarm.barh(
                y, _date(each.end_s) - _date(each.begin_s), left=_date(each.begin_s), height=0.5, color="#b3261e"
            )
        alarm.set_yticks(range(len(names)), names)
        for trouble in plan.troubles:
            for axes in (rate, drift, alarm):
                axes.axvspan(
                    _date(plan.begin_s + trouble.begin_s),
                    _date(plan.begin_s + trouble.end_s),
                    color="#f3c98b",
                    alpha=0.5,
                )
            rate.text(_date(plan.begin_s + trouble.begin_s), rate.get_ylim()[1], trouble.kind, va="bottom", fontsize=8)
        locator = DayLocator(interval=2)
        alarm.xaxis.set_major_locator(locator)
        alarm.xaxis.set_major_formatter(ConciseDateFormatter(locator))
        for axes in (rate, drift, alarm):
            axes.grid(color="#dddddd", linewidth=0.5)
            axes.spines[["top", "right"]].set_visible(False)
        figure.savefig(IMAGES / "monitoring-month.png", dpi=80)


def draw_bad_week(found: prometheus.Prometheus, plan: month.Plan) -> None:
    """The dashboard Line around the bad lot."""
    board = dashboards()["line"]
    begin_s, end_s = (
        plan.begin_s + (BAD_DAYS[0] - 1) * month.DAY_S,
        plan.begin_s + (BAD_DAYS[0] + 1) * month.DAY_S - 2 * month.HOUR_S,
    )
    query = partial(query_target, found, None, begin_s, end_s, "20m", "1w")
    chosen = [panel for panel in panels() if panel.board == "line"]
    title = "Line: the day of a bad lot and the day before, simulated, drawn by the project, not by Grafana"
    draw(board, chosen, query, IMAGES / "monitoring-bad-lot.png", title)


def main() -> None:
    """Do all, or what is requested."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", choices=("alerts", "demo", "month"))
    only = parser.parse_args().only
    if only != "alerts" and (name := prometheus.missing()) is not None:
        raise SystemExit(f"{name} is missing: apt-get install prometheus")
    text = with_part(DOCUMENT.read_text(encoding="utf-8"), "alerts", alerts())
    if only in {None, "demo"}:
        of_demonstration()
    if only in {None, "month"}:
        text = with_part(text, "month", of_month())
    DOCUMENT.write_text(text, encoding="utf-8")


def _at(at_s: float) -> str:
    return f"{datetime.fromtimestamp(at_s, UTC):%d %b %H:%M}"


def _date(at_s: float) -> float:
    return float(date2num(datetime.fromtimestamp(at_s, UTC)))


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
