"""The PLC's latency, the cycle's own time and the processor with no client, with panels, readers and browsers.

In turn in every round; the last browsers show the same page made with NiceGUI, the peer.
"""

import contextlib
import os
import statistics
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import psutil
from bench_plc import Figures, measured
from playwright.sync_api import Browser
from prometheus_client.parser import text_string_to_metric_families

NO_CLIENT, PANELS, READERS, BROWSERS, PEER = (
    "no client",
    "three panels",
    "ten readers of the history",
    "three browsers on these cores",
    "three browsers, NiceGUI's page",
)
PANEL_COUNT, HISTORY_READERS = 3, 10
OWN_PHASES = ("awaiting_measure", "measuring_last", "judging", "recording_accept", "recording_reject")
"""Of the cycle: what neither moves nor waits for a frame."""
SCAN_US = 10_000
MOST_PERCENT = 5
"""Wanted of three panels on two cores."""
CLIENTS = Path(__file__).with_name("clients.py")
CORES = os.cpu_count() or 1


class Round(NamedTuple):
    """Measurements of one condition in one round."""

    latency: Figures
    shares: dict[str, float]
    """By process, % of a core; `hmi` is the one that serves the pages, with the peer its own."""
    own_ms: float
    """Of the cycle: measuring, judging and recording, for which nothing moves, for each fruit."""


def own_time(url: str) -> tuple[float, float]:
    """The cycle's own seconds and its fruit since the station's start, by its metrics."""
    with urllib.request.urlopen(url, timeout=10) as answer:
        text = answer.read().decode()
    seconds = fruit = 0.0
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            if sample.name == "station_phase_duration_seconds_sum" and sample.labels["phase"].startswith(OWN_PHASES):
                seconds += sample.value
            fruit += sample.value if sample.name == "station_inspections_total" else 0.0
    return seconds, fruit


@contextlib.contextmanager
def clients(who: str, count: int, host: str, port: int) -> Iterator[None]:
    """Clients without a browser, as on machines of their own: one process for all.

    Args:
        who: `panels` or `readers`.
        count: of them.
        host: of the pages.
        port: of the pages.
    """
    command = [sys.executable, str(CLIENTS), host, str(port), str(count), who]
    # A session of its own: Ctrl-C on the terminal is the benchmark's, which ends them.
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    try:
        if process.stdout is None or process.stdout.readline() != "looking\n":
            raise SystemExit(f"the {who} got no pages")
        yield
        if process.poll() is not None:
            raise SystemExit(f"the {who} ended before the round did")
    finally:
        process.terminate()
        process.communicate(timeout=20)


@contextlib.contextmanager
def browsers(browser: Browser, host: str, port: int) -> Iterator[None]:
    """Browsers with the page Run, on the cores that the station has."""
    contexts = [browser.new_context() for _ in range(PANEL_COUNT)]
    try:
        for context in contexts:
            page = context.new_page()
            page.goto(f"http://{host}:{port}")
            page.locator("body:not(.stale)").wait_for()
        yield
    finally:
        for context in contexts:
            context.close()


def compared(
    conditions: dict[str, Callable[[], contextlib.AbstractContextManager[psutil.Process | None]]],
    parts: dict[str, psutil.Process],
    load: Callable[[float], Figures],
    metrics: str,
    rounds: int,
    seconds: float,
) -> dict[str, list[Round]]:
    """Each condition in each round, another one first each time; the processor while the latency is measured.

    Args:
        conditions: by name; one whose pages come from another process than the station's own gives that process.
        parts: the station's processes, by name.
        load: the PLC's reads for some seconds.
        metrics: address of the station's metrics.
        rounds: of all conditions.
        seconds: of each condition in each round.
    """
    found: dict[str, list[Round]] = {name: [] for name in conditions}
    names = list(conditions)
    for number in range(rounds):
        first = number % len(names)
        for name in names[first:] + names[:first]:
            with conditions[name]() as serving:
                processes = {**parts, "hmi": serving or parts["hmi"]}
                load(0.5)
                own_s, fruit = own_time(metrics)
                before = {part: sum(process.cpu_times()[:2]) for part, process in processes.items()}
                latency = load(seconds)
                after = {part: sum(process.cpu_times()[:2]) for part, process in processes.items()}
                later_s, later_fruit = own_time(metrics)
            shares = {part: 100 * (after[part] - before[part]) / seconds for part in parts}
            if later_fruit == fruit:
                raise SystemExit(f"no fruit was inspected in {seconds:g} s: give more seconds for a round")
            own_ms = 1000 * (later_s - own_s) / (later_fruit - fruit)
            found[name].append(Round(latency, shares, own_ms))
    return found


def plc_reader(program: Path, port: int) -> Callable[[float], Figures]:
    """The PLC, which reads once each scan for some seconds."""
    return lambda seconds: measured(program, port, 1, SCAN_US, seconds)


class Difference(NamedTuple):
    """Of two conditions, paired by their rounds."""

    median: float
    lowest: float
    highest: float
    confidence: float

    @property
    def beyond_noise(self) -> bool:
        """True if the interval does not contain 0."""
        return not self.lowest <= 0 <= self.highest


def difference(before: list[float], after: list[float]) -> Difference:
    """The paired differences' median, and an interval of theirs that holds the true median with 95 % or more.

    The sign test's: the true median is between the k-th lowest and the k-th highest of n with the probability
    1 - 2 P(B < k), B binomial with n and 1/2. Where no k reaches 95 %, their whole range, and what that reaches.
    """
    from scipy.stats import binom  # noqa: PLC0415 (not for the panels' own processes)

    ordered = sorted(late - early for early, late in zip(before, after, strict=True))
    number = len(ordered)
    reached = {k: float(1 - 2 * binom.cdf(k - 1, number, 0.5)) for k in range(1, (number + 1) // 2 + 1)}
    k = max((k for k, confidence in reached.items() if confidence >= 0.95), default=1)
    return Difference(statistics.median(ordered), ordered[k - 1], ordered[-k], reached[k])


class Row(NamedTuple):
    """A line of the table."""

    title: str
    unit: str
    digits: int
    of: Callable[[Round], float]


ROWS = (
    Row("the pages' process", "% of a core", 1, lambda each: each.shares["hmi"]),
    Row("the station's process", "% of a core", 1, lambda each: each.shares["service"]),
    Row("both processes", f"% of {CORES} cores", 1, lambda each: sum(each.shares.values()) / CORES),
    Row("the cycle's own time a fruit: measuring, judging, recording", "ms", 1, lambda each: each.own_ms),
    Row("PLC's latency at a 10 ms scan, p50", "µs", 0, lambda each: each.latency.p50_us),
    Row("PLC's latency at a 10 ms scan, p99", "µs", 0, lambda each: each.latency.p99_us),
    Row("PLC's latency at a 10 ms scan, worst", "µs", 0, lambda each: each.latency.worst_us),
)
PAGES, _, BOTH, OWN, P50, P99, _ = ROWS


def table(found: dict[str, list[Round]]) -> list[str]:
    """Medians over the rounds, and from the lowest round to the highest."""
    lines = ["| | " + " | ".join(found) + " |", "|---|" + "---|" * len(found)]
    for row in ROWS:
        cells = []
        for rounds in found.values():
            values = [row.of(each) for each in rounds]
            middle, low, high = (
                f"{each:,.{row.digits}f}" for each in (statistics.median(values), min(values), max(values))
            )
            cells.append(f"{middle} ({low} to {high})")
        lines.append(f"| {row.title}, {row.unit} | {' | '.join(cells)} |")
    return lines


def differences(found: dict[str, list[Round]]) -> list[str]:
    """Each condition against no client, round by round, the peer against our page, and what follows."""
    ours = [name for name in found if name not in {NO_CLIENT, PEER}]
    lines = ["| against no client | " + " | ".join(ours) + " |", "|---|" + "---|" * len(ours)]
    sentences = []
    by_row = {row: {name: _against(found, name, row) for name in ours} for row in (BOTH, OWN, P50, P99)}
    for row, each in by_row.items():
        cells = [
            f"{_signed(one.median, row)} ({_signed(one.lowest, row)} to {_signed(one.highest, row)})"
            for one in each.values()
        ]
        lines.append(f"| {row.title}, {row.unit} | {' | '.join(cells)} |")
    panels_cost = by_row[BOTH][PANELS]
    under = "less" if panels_cost.highest < MOST_PERCENT else "not surely less"
    sentences.append(f"- Three panels cost both processes together {under} than {MOST_PERCENT} % of {CORES} cores.")
    for name in ours:
        parts = [_sentence(row, by_row[row][name]) for row in (OWN, P50, P99)]
        sentences.append(f"- {name[0].upper()}{name[1:]}: {'; '.join(parts)}.")
    more = difference([PAGES.of(each) for each in found[BROWSERS]], [PAGES.of(each) for each in found[PEER]])
    sentences.append(
        f"- NiceGUI's page takes {_signed(more.median, PAGES)} ({_signed(more.lowest, PAGES)} to "
        f"{_signed(more.highest, PAGES)}) {PAGES.unit} against this page, for the same three browsers."
    )
    confidence = by_row[P99][PANELS].confidence
    note = (
        "Median of the rounds' differences, and the interval that holds the true median with "
        f"{100 * confidence:.0f} % (sign test). From it:"
    )
    return [*lines, "", note, "", *sentences]


def _against(found: dict[str, list[Round]], name: str, row: Row) -> Difference:
    return difference([row.of(each) for each in found[NO_CLIENT]], [row.of(each) for each in found[name]])


def _signed(value: float, row: Row) -> str:
    return f"{value:+,.{row.digits}f}".replace("-", "\N{MINUS SIGN}")


def _sentence(row: Row, found: Difference) -> str:
    name = row.title.partition(":")[0] if row is OWN else row.title.rpartition(" ")[2]
    if not found.beyond_noise:
        return f"no difference of {name} beyond noise"
    more = "more" if found.median > 0 else "less"
    return f"{name} is {abs(found.median):,.0f} {row.unit} {more}, which is beyond noise"


def conditions_of(rounds: int, seconds: float) -> str:
    """Under which circumstances this was measured."""
    return (
        f"{rounds} rounds of {seconds:g} s for each, another first in each round; median, and lowest to highest round. "
        f"FastAPI {version('fastapi')}, uvicorn {version('uvicorn')}, Python {sys.version.split()[0]}, {CORES} cores "
        "that twin, station, line, clients and other work share."
    )
