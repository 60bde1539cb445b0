"""The soak's page and its plot."""

import os
import statistics
import textwrap
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sorting import tables

from .cell import ACCEPTED_SHARE, BATCH, CLOSING_MM_S, DAMAGED_SHARE, EARLIER, KINDS, PANELS, QUOTA_MB, READERS
from .samples import MARKS, TWIN, ProcessSample, Sample
from .slopes import CONFIDENCE, Slope, Verdict, slope

CHART = Path(__file__).resolve().parents[2] / "docs" / "images" / "soak.svg"
WARM_UP_SHARE = 0.25
"""Of the run, over which nothing is decided: allocators, caches and pools fill, and so do the images' quota."""
MOST_MB_PER_HOUR = 1.0
MOST_PIECES_PER_HOUR = 1.0
"""Descriptors and threads: flat is less than one more in an hour."""
MOST_SHARE_PER_HOUR = 0.1
"""Latency and times: flat is less than a tenth of their median more in an hour."""
RETURN_S = 120.0
"""A minute, after which the service returns freed memory, and another, in which it takes it again."""
WIDTH = 120
"""Of the page's lines."""
DECIDES_S = 1200.0
"""Of samples after the warm-up: fewer decide nothing, as what rises by steps may not have made one. An estimate."""
PACE_A_MINUTE = 18
"""Of a line by the shipped recipes: docs/line-pace.md."""
FOUND = """\
## What was found and fixed

| cause | effect | now |
|---|---|---|
| each request to the arm's process left a cancelled wait behind (Python 3.11) | +27 MB an hour | one shared wait \
(`tests/devices/arm/test_process_messages.py`) |
| one kept error was raised again at each check; its traceback grew | grows while the arm waits for a person | \
raised without it (`tests/test_errors.py`) |
| each thread's heap kept its largest images | 171 MB after 13 min | one heap for all threads: 159 MB \
(`tests/test_memory.py`) |
| freed memory was retained | steps of 2 to 4 MB | returned once a minute, also during the retreat |
| `pathlib` interns each part of a path | a step of some 3 MB (inferred); never given back in Python 3.12 before \
3.12.7 | image and unfinished files do not use `pathlib` (`tests/records/test_images.py`, \
`tests/test_atomic_file.py`) |

The log's newest 1,000 lines fill in some 40 minutes, at 0.34 kB a line.\
"""
"""Written by hand: the stories behind a figure that was wrong once."""


class Ending(NamedTuple):
    """End of a run: fruit by decision, and the inspections that PostgreSQL did not get."""

    decided: dict[str, int]
    """Fruit by the line's decision."""
    unsent: int | None
    """Inspections that PostgreSQL did not get; None where that was not awaited."""


class Series(NamedTuple):
    """A quantity over time."""

    name: str
    at_s: list[float]
    values: list[float]

    @property
    def slope(self) -> Slope | None:
        """Slope with its interval; None for too few samples."""
        return slope(self.at_s, self.values)

    def below(self, limit: float) -> Verdict:
        """Return whether the series rises by less than a limit in an hour; `UNDECIDED` where it is too short for that.

        Args:
            limit: in the series' own unit.
        """
        rise = self.slope
        decides = rise is not None and self.at_s[-1] - self.at_s[0] >= DECIDES_S
        return rise.below(limit) if rise is not None and decides else Verdict.UNDECIDED


def settled(samples: Sequence[Sample]) -> list[Sample]:
    """Return the samples after the warm-up."""
    return [each for each in samples if each.at_s >= WARM_UP_SHARE * samples[-1].at_s]


def of_process(samples: Sequence[Sample], name: str, what: Callable[[ProcessSample], float]) -> Series:
    """Return a quantity of a process, since its last restart.

    Args:
        samples: of the time of interest.
        name: of the process.
        what: the quantity.
    """
    present = [(each.at_s, each.processes[name]) for each in samples if name in each.processes]
    last = [(at_s, process) for at_s, process in present if process.pid == present[-1][1].pid]
    return Series(name, [at_s for at_s, _ in last], [what(process) for _, process in last])


def of_each_return(series: Series, chosen: Callable[[Sequence[tuple[float, float]]], tuple[float, float]]) -> Series:
    """Return one value of each two minutes, wherever between two returns of freed memory the samples were.

    Args:
        series: memory.
        chosen: `max` for what the process comes to need, `min` for what it has in use between two fruit.
    """
    places = dict[int, list[tuple[float, float]]]()
    for at_s, value in zip(series.at_s, series.values, strict=True):
        places.setdefault(int(at_s // RETURN_S), []).append((value, at_s))
    values, times = zip(*map(chosen, places.values()), strict=True)
    return series._replace(at_s=list(times), values=list(values))


class Memory(NamedTuple):
    """A process's memory after the warm-up."""

    own: Series
    """That no other process shares: the most of each two minutes."""
    in_use: Series
    """Of that, what is not free in the process's heap: the least of each two minutes."""


def memory_of(samples: Sequence[Sample], name: str) -> Memory:
    """Return a process's memory, since its last restart.

    Args:
        samples: of the time of interest.
        name: of the process.
    """
    own = of_process(samples, name, lambda each: each.unique_mb)
    in_use = of_process(samples, name, lambda each: each.in_use_mb)
    return Memory(of_each_return(own, max), of_each_return(in_use, min))


class Timing(NamedTuple):
    """A time that a line would feel, and a time of the same kind in which the station has no part."""

    station: Series
    machine: Series | None = None
    """At the same times; None where there is no such thing."""

    @property
    def judged(self) -> Series:
        """The station's share of the two, which the machine's speed does not move; in percent of its median."""
        values = self.station.values
        if self.machine is not None:
            values = [ours / bare for ours, bare in zip(values, self.machine.values, strict=True)]
        middle = statistics.median(values)
        return self.station._replace(values=[100 * value / middle for value in values])


def rounds_of_kinds(samples: Sequence[Sample]) -> list[list[Sample]]:
    """Return runs of samples in which all kinds came by: each begins with the last one of the run before.

    A kind has its own time, so that a shorter time shows more of the kind than of the station. A restart of the service
    sets its counts back, and begins anew.
    """
    runs, run = list[list[Sample]](), list(samples[:1])
    for before, sample in pairwise(samples):
        run = [*run, sample] if sample.counts.fruit >= before.counts.fruit else [sample]
        if sample.counts.fruit - run[0].counts.fruit >= BATCH * len(KINDS):
            runs.append(run)
            run = [sample]
    return runs


def timings(samples: Sequence[Sample]) -> list[Timing]:
    """Return what a line would feel: the PLC's latency and the cycle's times, of which a fruit's share is taken."""
    at_s = [each.at_s for each in samples]
    latencies = [
        Timing(
            Series(f"PLC's reply, {name}, µs", at_s, [of(each.latency) for each in samples]),
            Series(f"bare server's reply, {name}, µs", at_s, [of(each.bare) for each in samples]),
        )
        for name, of in (("p50", lambda each: each.p50_us), ("p99", lambda each: each.p99_us))
    ]
    runs = rounds_of_kinds(samples)
    ends_s = [run[-1].at_s for run in runs]

    def by_fruit(total: Callable[[Sample], float]) -> list[float]:
        return [(total(run[-1]) - total(run[0])) / (run[-1].counts.fruit - run[0].counts.fruit) for run in runs]

    work = [statistics.fmean(each.work_ms for each in run[1:]) for run in runs]
    own, whole = by_fruit(lambda each: 1000 * each.counts.own_s), by_fruit(lambda each: each.counts.whole_s)
    return [
        *latencies,
        Timing(Series("cycle's own time, ms", ends_s, own), Series("fixed piece of work, ms", ends_s, work)),
        Timing(Series("trigger to outcome, s", ends_s, whole)),
    ]


def restarts(samples: Sequence[Sample], name: str) -> int:
    """Return how often a process was another one than before."""
    pids = [each.processes[name].pid for each in samples if name in each.processes]
    return sum(before != after for before, after in pairwise(pids))


def in_words(rise: Slope | None, digits: int) -> str:
    """Return a slope with its interval."""
    if rise is None:
        return "too few samples"
    middle, low, high = (f"{each:+.{digits}f}".replace("-", "\N{MINUS SIGN}") for each in rise)
    return f"{middle} ({low} to {high})"


def memory_table(samples: Sequence[Sample]) -> list[str]:
    """Return each process's memory."""
    after = settled(samples)
    limit, rises = f"under {MOST_MB_PER_HOUR:g} MB/h", f"MB/h ({CONFIDENCE:.0%})"
    heads = ("MB: first", "after the warm-up", "last", "most", "resident, last", rises, limit)
    in_use_heads = ("in use, MB", f"in use: {rises}", f"in use: {limit}")
    lines = tables.header("process", *heads, *in_use_heads, "restarts")
    for name in present(samples):
        every = of_process(samples, name, lambda each: each.unique_mb).values
        late = of_process(after, name, lambda each: each.unique_mb)
        resident = of_process(after, name, lambda each: each.resident_mb).values[-1]
        figures = (f"{each:.1f}" for each in (every[0], late.values[0], late.values[-1], max(every), resident))
        own, in_use = (_rise_of_memory(each) for each in memory_of(after, name))
        used = f"{statistics.median(memory_of(after, name).in_use.values):.1f}"
        lines.append(tables.row(name, *figures, *own, used, *in_use, str(restarts(samples, name))))
    return lines


def _rise_of_memory(series: Series) -> tuple[str, str]:
    """The rise, and whether it is under the limit."""
    return in_words(series.slope, 2), "" if series.name == TWIN else series.below(MOST_MB_PER_HOUR)


def pieces_table(samples: Sequence[Sample]) -> list[str]:
    """Return each process's descriptors and threads."""
    after = settled(samples)
    names = [
        f"{what}{column}" for what in ("descriptors: ", "threads: ") for column in ("least, most", "an hour", "flat")
    ]
    lines = tables.header("process", *names)
    for name in present(samples):
        cells = []
        for what in (lambda each: each.descriptors, lambda each: each.threads):
            late = of_process(after, name, what)
            held = "" if name == TWIN else late.below(MOST_PIECES_PER_HOUR)
            cells += [f"{min(late.values):.0f}, {max(late.values):.0f}", in_words(late.slope, 1), held]
        lines.append(tables.row(name, *cells))
    return lines


def timings_table(samples: Sequence[Sample]) -> list[str]:
    """Return the PLC's latency and the cycle's times."""
    per_hour = f"% an hour ({CONFIDENCE:.0%})"
    lines = tables.header("", "median", "least, most of a window", per_hour, f"of its share: {per_hour}", "flat")
    for each in timings(settled(samples)):
        if each.station.values:
            share = "" if each.machine is None else in_words(each.judged.slope, 1)
            lines.append(_timing(each.station, share, each.judged.below(100 * MOST_SHARE_PER_HOUR)))
            if each.machine is not None:
                lines.append(_timing(each.machine, "", ""))
    return lines


def _timing(series: Series, share: str, flat: str) -> str:
    least_most = f"{min(series.values):,.4g}, {max(series.values):,.4g}"
    rise = in_words(Timing(series).judged.slope, 1)
    return tables.row(series.name, f"{statistics.median(series.values):,.4g}", least_most, rise, share, flat)


def present(samples: Sequence[Sample]) -> list[str]:
    """Return the processes that were there after the warm-up, in their order."""
    return [name for name in MARKS if any(name in each.processes for each in settled(samples))]


def undecided(samples: Sequence[Sample]) -> str:
    """Return what is to be done about slopes whose interval has the limit within it; empty where there are none."""
    after = settled(samples)
    series = [each for name in present(samples) if name != TWIN for each in memory_of(after, name)]
    if all(each.below(MOST_MB_PER_HOUR) is not Verdict.UNDECIDED for each in series):
        return ""
    return (
        "\n**Not decided**: the interval of at least one process's memory has the limit within it; a longer run "
        "narrows it.\n"
    )


def page(samples: Sequence[Sample], ending: Ending, minutes: float, trouble: str, load: float) -> str:
    """Return the document.

    Args:
        samples: at least one.
        ending: how the run ended.
        minutes: for how long it was to run.
        trouble: what ended it early, if anything did but a person.
        load: of the machine.
    """
    last, after = samples[-1], settled(samples)
    ran_min = last.at_s / 60
    fruit = round(last.counts.fruit)
    begins_min = next((each.at_s / 60 for each in samples if each.counts.images_removed), None)
    removing = "none was removed" if begins_min is None else f"they were removed from minute {begins_min:.1f} on"
    early = f" It was to run for {minutes:g} minutes." if last.at_s < 60 * minutes - 1 else ""
    stopped = f" **It ended early: {trouble}.**" if trouble else ""
    decisions = ", ".join(f"{number} {how}" for how, number in ending.decided.items()) or "not known"
    unsent = "not awaited" if ending.unsent is None else str(ending.unsent)
    ran = (
        f"Written by `./run bench soak`, which ran for {ran_min:.0f} minutes.{early}{stopped} The station's own "
        "processes, the twin and a line that lays fruit after fruit, as fast as the station takes them; "
        f"{PANELS} panels with the page Run, {READERS} readers of the history, PostgreSQL and an MQTT broker. The "
        "PLC's latency is that of a second client, which reads every 10 ms. Unverified on hardware."
    )
    worth = (
        f"**{fruit} fruit**, {fruit / ran_min:.0f} a minute: a line at {PACE_A_MINUTE} fruit a minute needs "
        f"**{fruit / PACE_A_MINUTE / 60:.1f} hours** for as many. What grows with each fruit is tested for that long; "
        "what grows with time (frames, heartbeats, streams) for the run's own time. A slope is given for "
        f"an hour. To have more fruit, the jaws close at {CLOSING_MM_S} mm/s (shipped: 20); {DAMAGED_SHARE:.0%} of the "
        f"fruit are damaged, and the recipe changes every {BATCH} fruit. The records begin with {EARLIER} inspections, "
        f"eight hours at that pace, which PostgreSQL gets first. The images' quota is {QUOTA_MB} MB, and "
        f"{ACCEPTED_SHARE:.0%} of the passed fruit's are stored (shipped: 2 %): {removing}."
    )
    deciding = (
        f"The warm-up, the first {WARM_UP_SHARE:.0%} ({after[0].at_s / 60:.0f} minutes), is not judged. A slope is the "
        "median of the slopes of all pairs (Theil, Sen); its interval is widened for the autocorrelation of the series "
        "(Hamed, Rao). A verdict needs the whole interval on one side of the limit, and "
        f"{DECIDES_S / 60:.0f} minutes of samples; else it is *not decided*. Memory is what no other process shares "
        f"(USS); its slope is that of the largest value of each {RETURN_S / 60:.0f} minutes, since once a minute the "
        "service returns freed memory and takes it again with the next fruit. *In use* is the part of it that is not "
        "free in the C library's heap, whose chunks are counted from outside (of a heap that cannot be walked, as the "
        f"twin's, all of it); its slope is that of the smallest value of each {RETURN_S / 60:.0f} minutes. A heap that "
        "had to grow once, because more happened at the same time, keeps that size; memory that is never freed counts "
        "as in use."
    )
    flat = (
        f"Flat is less than {MOST_PIECES_PER_HOUR:g} more in an hour; of latency and times, less than "
        f"{MOST_SHARE_PER_HOUR:.0%} of the median more. The twin is none of the station's processes. A machine that "
        "others use is faster in one half hour than in the next. So a reply is judged by its share of what the same "
        "server with no station behind it took for its own in the same window, and the cycle's own time by its share "
        f"of a fixed piece of work. The times of the cycle are means over some {BATCH * len(KINDS)} fruit, in which "
        "all kinds come by."
    )
    images = (
        f"- Images on the disk: at most {max(each.images_mb for each in after):.0f} MB after the warm-up; "
        f"{last.counts.images_kept:.0f} images were stored, {last.counts.images_removed:.0f} of them removed. The "
        f"database with its log: {after[0].database_mb:.1f} MB after the warm-up, {last.database_mb:.1f} MB at the end."
    )
    outbox = (
        f"- Outbox: at most {max(each.counts.waiting for each in after):.0f} entries waited after the warm-up; "
        f"inspections that PostgreSQL lacked at the end: {unsent}."
    )
    lines = [
        "# Soak: what grows in a station that runs on",
        "",
        *textwrap.wrap(ran, WIDTH),
        "",
        *textwrap.wrap(worth, WIDTH),
        "",
        *textwrap.wrap(deciding, WIDTH),
        undecided(samples),
        *memory_table(samples),
        "",
        "![Memory, descriptors, latency and records over time](images/soak.svg)",
        "",
        *pieces_table(samples),
        "",
        *textwrap.wrap(flat, WIDTH),
        "",
        *timings_table(samples),
        "",
        f"- Decided: {decisions}.",
        *textwrap.wrap(images, WIDTH, subsequent_indent="  "),
        *textwrap.wrap(outbox, WIDTH, subsequent_indent="  "),
        "",
        FOUND,
        "",
        f"Machine: {os.cpu_count()} cores, load {load:.1f}, which twin, line, clients, databases and station share.",
        "",
    ]
    return "\n".join(lines)


def draw(samples: Sequence[Sample], file: Path) -> None:
    """Draw everything over time.

    Args:
        samples: at least one.
        file: the SVG.
    """
    figure = Figure(figsize=(9, 9.5), layout="constrained")
    memory, pieces, latency, disk = figure.subplots(4, 1, sharex=True)
    after = settled(samples)
    for name in present(samples):
        every = of_process(samples, name, lambda each: each.unique_mb)
        base = of_process(after, name, lambda each: each.unique_mb).values[0]
        _line(memory, every._replace(values=[value - base for value in every.values]), dashed=name == TWIN)
        _line(pieces, of_process(samples, name, lambda each: each.descriptors + each.threads), dashed=name == TWIN)
    for timing in timings(samples)[:2]:
        _line(latency, timing.station)
        if timing.machine is not None:
            _line(latency, timing.machine, dashed=True)
    at_s = [each.at_s for each in samples]
    _line(disk, Series("images", at_s, [each.images_mb for each in samples]))
    _line(disk, Series("database", at_s, [each.database_mb for each in samples]))
    memory.set_ylabel("MB since the warm-up")
    memory.set_ylim(-10, 10)
    pieces.set_ylabel("descriptors and threads")
    latency.set_ylabel("µs")
    latency.set_yscale("log")
    disk.set_ylabel("MB of the records")
    disk.set_xlabel("minutes since the first fruit")
    for axes in (memory, pieces, latency, disk):
        axes.axvspan(0, after[0].at_s / 60, color="#eeeeee", zorder=0)
        axes.grid(color="#dddddd", linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=8)
    file.parent.mkdir(exist_ok=True)
    with mpl.rc_context({"svg.hashsalt": "soak"}):
        figure.savefig(file, metadata={"Date": None})


def _line(axes: Axes, series: Series, *, dashed: bool = False) -> None:
    axes.plot(
        [at_s / 60 for at_s in series.at_s],
        series.values,
        label=series.name,
        linewidth=1.0,
        linestyle="--" if dashed else "-",
        marker="." if len(series.values) == 1 else "",
    )
