"""A fleet of ten stations: whole ones at once, a year of their records and metrics, and a study on a cluster.

Run with `./run bench fleet`: ten stations with their twins report to one PostgreSQL and one Prometheus; the boards
Quality and Fleet query a year of ten stations; a cohort is measured on a Dask cluster of processes. Writes
docs/fleet.md; `--only live`, `records`, `metrics` or `study` renews that part alone. Exits 1 where books differ or a
query over a year takes longer than 1 s.
"""

# ruff: noqa: E501 (a line of the page is longer with its expressions than it is printed)
import argparse
import asyncio
import os
import resource
import statistics
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from archive import postgres
from fleet import cohort, metrics_year, plain, stations, year
from monitoring.document import with_part
from monitoring.ports import free_ports
from monitoring.prometheus import Prometheus, missing, promtool, running, write_configuration
from monitoring.queries import dashboards, panels, promql, sql

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "fleet.md"
STATIONS = 10
EVERY_S, FRUITS = 60.0, 5
"""Each line's pace while ten share two cores, and how many fruit it has: a whole station at its full pace takes half a
core (docs/sizing.md), and its twin as much again."""
SCRAPE = "15s"
"""As deployed."""
SEASON_DAYS = 200
"""Of the year: fields and tunnels from March to September."""
YEAR_DAYS = 365
LIMIT_S = 1.0
YEAR_END_S = 1_790_006_400
"""2026-09-21 16:00 UTC, a whole block of 4 h."""
COHORT, COHORT_RUNS = 40, 3
_ARRIVAL_S = 120.0


class Part(NamedTuple):
    """One part of the page, and what is wrong in it."""

    text: str
    wrong: list[str]


def live(number_of: int) -> Part:
    """Whole stations at once."""
    free = free_ports(4 * number_of)
    with tempfile.TemporaryDirectory() as name, database() as server:
        folder = Path(name)
        cells = [
            stations.prepare(folder, number, f"127.91.26.{number}", free[4 * number - 4 : 4 * number], server.folder)
            for number in range(1, number_of + 1)
        ]
        return asyncio.run(at_once(cells, folder, server))


async def at_once(cells: Sequence[stations.Cell], folder: Path, server: Any) -> Part:
    """Run the lines of all cells, and compare the books."""
    configuration = write_configuration(folder, SCRAPE, {cell.name: cell.metrics for cell in cells})
    used_s = processor_s()
    began_s = time.monotonic()
    async with stations.running(cells):
        ready_s = time.monotonic() - began_s
        with running(folder, configuration) as prometheus:
            began_s = time.monotonic()
            await asyncio.gather(
                *(stations.inspect(cell, FRUITS, EVERY_S, n * EVERY_S / len(cells)) for n, cell in enumerate(cells))
            )
            took_s = time.monotonic() - began_s
            load = os.getloadavg()
            own = {cell.name: stations.recorded(cell) for cell in cells}
            counted = await arrival(prometheus, server, cells, own)
            window = f"[{took_s:.0f}s]"
            down = [each.labels["station"] for each in prometheus.now(f"min_over_time(up{window}) < 1")]
            scrapes = prometheus.now(f"sum(count_over_time(up{window}))")[0].points[0][1]
    cores = (processor_s() - used_s) / (time.monotonic() - began_s + ready_s)
    arrived = {cell.name: rows_of(server, cell.name) for cell in cells}
    wrong = [
        line
        for cell in cells
        for line in stations.disagreements(cell, own[cell.name], arrived[cell.name], counted[cell.name], FRUITS)
    ]
    wrong += [f"{name}: a scrape of Prometheus was not answered" for name in down]
    decided = sum((stations.at_plc(cell) for cell in cells), Counter())
    cycles_s = [passage.cycle_s for cell in cells for passage in cell.passages]
    with server.connect() as connection:
        twice = connection.execute(
            "SELECT count(*) - count(DISTINCT (station, sequence)), (SELECT count(*) FROM refused) FROM inspections"
        ).fetchone()
    if twice != (0, 0):
        wrong.append(f"PostgreSQL has {twice[0]} inspections twice and refused {twice[1]} rows")
    outcomes = ", ".join(f"{number} {name}" for name, number in sorted(decided.items()))
    text = f"""
{len(cells)} stations of {len(list(cells[0].site.home.glob("logs/*.log")))} processes each (twin, service, PLC interface,
outbox; no pages) on {os.cpu_count()} cores, one fruit every {EVERY_S:g} s at each, so {60 * len(cells) / EVERY_S:g} a
minute in all; slowed: the arm's state at {stations.ARM_HZ} Hz, PLC scans of {stations.SCAN_S * 1000:g} ms. Started one after another in {ready_s:.0f} s; {cores:.1f} cores used on average, load
{load[0]:.1f} at the end.

| | |
| --- | --- |
| fruit decided by the lines | {len(cycles_s)} in {took_s / 60:.1f} min: {outcomes} |
| refused, no answer or late at a PLC | {sum(decided[each] for each in stations.UNWANTED)} |
| trigger to decision, s: median, most | {statistics.median(cycles_s):.1f}, {max(cycles_s):.1f} |
| inspections in PostgreSQL | {sum(map(len, arrived.values()))} of {sum(map(len, own.values()))} recorded |
| twice there, rows refused | {twice[0]}, {twice[1]} |
| scrapes by Prometheus, every {SCRAPE} | {scrapes:.0f}; stations of which one was not answered: {len(down)} |
| differences between PLC, records, PostgreSQL, Prometheus | {len(wrong)} |
"""
    return Part(text, wrong)


async def arrival(
    prometheus: Prometheus, server: Any, cells: Sequence[stations.Cell], own: dict[str, dict[int, str]]
) -> dict[str, dict[str, int]]:
    """Wait until PostgreSQL has every entry and Prometheus every count; the counts by station and outcome."""
    wanted = {cell.name: stations.last_entry(cell) for cell in cells}
    until_s = time.monotonic() + _ARRIVAL_S
    while True:
        counted: dict[str, dict[str, int]] = {cell.name: {} for cell in cells}
        for each in await asyncio.to_thread(
            prometheus.now, "sum by (station, outcome) (station_inspections_total) > 0"
        ):
            counted[each.labels["station"]][each.labels["outcome"]] = int(each.points[0][1])
        with server.connect() as connection:
            arrived = dict(connection.execute("SELECT station, max(last_entry) FROM stations GROUP BY 1").fetchall())
        there = arrived == wanted and all(counted[name] == Counter(rows.values()) for name, rows in own.items())
        if there or time.monotonic() > until_s:
            return counted
        await asyncio.sleep(1.0)


def rows_of(server: Any, station: str) -> list[tuple[int, str]]:
    """Number and outcome of each of a station's inspections in PostgreSQL."""
    with server.connect() as connection:
        return connection.execute("SELECT sequence, outcome FROM inspections WHERE station = %s", (station,)).fetchall()


def processor_s() -> float:
    """Processor time of this process and of those that it started and that have ended, s."""
    each = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in each)


def records(days: int) -> Part:
    """A year of ten stations in PostgreSQL, and the dashboard Quality on it."""
    queries = {panel.title: target["rawSql"] for panel in panels() for target in panel.targets if "rawSql" in target}
    for variable in dashboards()["quality"]["templating"]["list"]:
        if variable["type"] == "query":
            queries[f"{variable['name']} (variable)"] = variable["query"]
    with database() as server:
        began_s, done = time.monotonic(), 0

        def on_day() -> None:
            nonlocal done
            done += 1
            report(f"day {done} of {days} after {time.monotonic() - began_s:.0f} s")

        inspections = year.load(server, STATIONS, days, on_day)
        loaded_s = time.monotonic() - began_s
        found = []
        for each in year.measure(server, queries, days, STATIONS, sql):
            report(str(each))
            found.append(each)
        with server.connect() as connection:
            sizes = connection.execute(
                "SELECT pg_size_pretty(pg_total_relation_size('inspections')), pg_size_pretty("
                "pg_total_relation_size('hourly_outcomes') + pg_total_relation_size('hourly_reasons') + "
                "pg_total_relation_size('hourly_values')), (SELECT count(*) FROM hourly_outcomes) + "
                "(SELECT count(*) FROM hourly_reasons) + (SELECT count(*) FROM hourly_values)"
            ).fetchone()
            version = connection.info.parameter_status("server_version")
    rows = [
        "| query of the dashboard Quality | day | month | year | year, worst | year, on the inspections | answers |",
        "|---" * 7 + "|",
    ]
    for title in queries:
        day, month, whole = (each for each in found if each.panel == title)
        beside = "the same query" if whole.plain_s is None else f"{whole.plain_s:.2f}"
        alike = "the same" if day.same and month.same and whole.same else "DIFFERENT"
        rows.append(
            f"| {title} | {day.median_s:.3f} | {month.median_s:.3f} | {whole.median_s:.3f} | {whole.worst_s:.3f} | "
            f"{beside} | {alike} |"
        )
    wrong = [f"{each.panel}, {each.range}: another answer than the inspections" for each in found if not each.same]
    wrong += [f"{each.panel}, {each.range}: {each.worst_s:.2f} s" for each in found if each.worst_s > LIMIT_S]
    worst = max(found, key=lambda each: each.worst_s)
    slowest = max((each for each in found if each.plain_s is not None), key=lambda each: each.plain_s or 0.0)
    rows += [f"| slowest of all | | | | {worst.worst_s:.3f} | {slowest.plain_s or 0:.2f} | |"]
    table = "\n".join(rows)
    text = f"""
{STATIONS} stations, {year.A_MINUTE} fruit a minute, {year.HOURS} h a day, {days} days: {inspections:,} inspections, made
in {loaded_s / 60:.1f} min through the deployed schema and its triggers by a series in the server: {sizes[0]}; the
summaries by hour {sizes[1]}, {sizes[2]:,} rows. PostgreSQL {version} with its default settings, as deployed. Seconds,
median of {year.RUNS} runs; beside it the same question put to the inspections themselves, once, as the
dashboard did before.
Medians are compared to {plain.MEDIAN_TOLERANCE:.1%}, all else exactly.

{table}

Load {os.getloadavg()[0]:.1f}. Queries above {LIMIT_S:g} s: {sum(each.worst_s > LIMIT_S for each in found)}.
"""
    return Part(text, wrong)


def make_block(folder: Path, begin_s: int, end_s: int) -> int:
    """Make a block of Prometheus' data; the number of samples."""
    file = folder / f"{begin_s}.txt"
    names = [f"station-{number}" for number in range(1, STATIONS + 1)]
    samples = metrics_year.write_block(file, names, begin_s, end_s, YEAR_END_S)
    duration = f"--max-block-duration={metrics_year.BLOCK_S}s"
    promtool("tsdb", "create-blocks-from", "openmetrics", "--quiet", duration, file, folder / "data")
    file.unlink()
    return samples


def metrics() -> Part:
    """A year of ten stations in Prometheus, and the dashboard Fleet on it."""
    began_s = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "data").mkdir()
        with ProcessPoolExecutor(os.cpu_count()) as pool:
            making = [pool.submit(make_block, folder, *block) for block in metrics_year.blocks(YEAR_END_S, YEAR_DAYS)]
            samples = 0
            for number, each in enumerate(making, 1):
                samples += each.result()
                report(f"block {number} of {len(making)} after {time.monotonic() - began_s:.0f} s")
        made_s = time.monotonic() - began_s
        queries = [
            (panel.title, promql(target["expr"], ".+", "1m"), panel.data["type"] == "timeseries")
            for panel in panels()
            if panel.board == "fleet"
            for target in panel.targets
        ]
        configuration = write_configuration(folder, SCRAPE, {})
        with running(folder, configuration, "--storage.tsdb.retention.time=10y") as prometheus:
            found = list(metrics_year.measure(prometheus, queries, YEAR_END_S - metrics_year.STEP_S))
    rows = [
        "| query of the dashboard Fleet | series | day | month | year | year, worst |",
        "|---" * 6 + "|",
    ]
    for day, month, whole in zip(found[::3], found[1::3], found[2::3], strict=True):
        rows.append(
            f"| {day.panel} | {whole.series} | {day.median_s:.3f} | {month.median_s:.3f} | {whole.median_s:.3f} | "
            f"{whole.worst_s:.3f} |"
        )
    wrong = [f"{each.panel}, {each.range}: {each.worst_s:.2f} s" for each in found if each.worst_s > LIMIT_S]
    wrong += [f"{each.panel}: no answer" for each in found if not each.series]
    table = "\n".join([*rows, f"| slowest of all | | | | | {max(each.worst_s for each in found):.3f} |"])
    text = f"""
{STATIONS} stations, {YEAR_DAYS} days, a sample every {metrics_year.STEP_S // 60} minutes of each series that the dashboard
asks for, scraped or as the deployed rules record it: {samples:,} samples, made in {made_s / 60:.1f} min. Seconds, median of
{metrics_year.RUNS} runs; a curve has {metrics_year.POINTS} points, a number or table is of the last moment.

{table}

Load {os.getloadavg()[0]:.1f}. Queries above {LIMIT_S:g} s: {sum(each.worst_s > LIMIT_S for each in found)}.
"""
    return Part(text, wrong)


def study() -> Part:
    """A cohort in one process, and on clusters of one and two workers, in turn."""
    runs = []
    with tempfile.TemporaryDirectory() as name:
        for number in range(COHORT_RUNS):
            for workers in (0, 1, 2):
                runs.append(cohort.measure(Path(name) / f"{number}-{workers}", workers, COHORT))
                report(f"{workers} workers: {runs[-1].took_s:.1f} s")
    took_s = {workers: [run.took_s for run in runs if run.workers == workers] for workers in (0, 1, 2)}
    differing = cohort.different(runs)
    alone_s = statistics.median(took_s[1])
    names = {0: "one process, no cluster", 1: "Dask cluster, 1 process", 2: "Dask cluster, 2 processes"}
    rows = ["| where | s: median | fastest, slowest | speed-up over 1 process of the cluster |", "|---" * 4 + "|"]
    rows += [
        f"| {names[workers]} | {statistics.median(each):.1f} | {min(each):.1f}, {max(each):.1f} | "
        f"{alone_s / statistics.median(each):.2f} |"
        for workers, each in took_s.items()
    ]
    table = "\n".join(rows)
    text = f"""
{COHORT} samples of {cohort.FRUIT}, seed {cohort.SEED}, `{cohort.METHOD}`, {COHORT_RUNS} runs each in turn, every run
anew. The stored samples, curves and summary are compared byte by byte: **{len(differing)}** of
{len(runs) * len(runs[0].samples)} files differ.

{table}

{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}; the scheduler and the client share them with the workers.
"""
    return Part(text, [f"{name} differs" for name in differing])


def database() -> Any:
    """A PostgreSQL of its own, with the deployed schema."""
    programs = postgres.programs()
    if programs is None:
        raise SystemExit("PostgreSQL's programs are missing: apt-get install postgresql")
    return postgres.throwaway(programs)


def report(message: str) -> None:
    """Report progress."""
    print(message, file=sys.stderr, flush=True)


def main() -> int:
    """Make the parts, and write them into the page."""
    made: dict[str, Callable[[], Part]] = {
        "live": lambda: live(options.stations),
        "records": lambda: records(options.days),
        "metrics": metrics,
        "study": study,
    }
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=tuple(made))
    parser.add_argument("--stations", type=int, default=STATIONS, help="whole stations that run at once")
    parser.add_argument("--days", type=int, default=SEASON_DAYS, help="of the season of records")
    options = parser.parse_args()
    only = options.only
    if (name := missing()) is not None:
        raise SystemExit(f"{name} is missing: apt-get install prometheus")
    wrong = []
    for part, make in made.items():
        if only in {None, part}:
            found = make()
            print(found.text)
            wrong += found.wrong
            DOCUMENT.write_text(with_part(DOCUMENT.read_text("utf-8"), part, found.text), encoding="utf-8")
    for line in wrong:
        report(line)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
