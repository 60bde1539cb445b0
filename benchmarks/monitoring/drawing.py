"""A dashboard's panels, drawn from what Prometheus and PostgreSQL answer, in Grafana's places, for a visual check.

This is not Grafana: it shows that a panel has the right data, unit and legend, not how Grafana renders it.
"""

import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from .prometheus import Series
from .queries import Panel

_CELL_IN, _ROW_IN = 0.62, 0.36
_COLORS = ("#1f4e79", "#c55a11", "#2e7d32", "#7b1fa2", "#00838f", "#8d6e63", "#b3261e", "#5d6d00", "#455a64", "#ad1457")
_OUTCOMES = {"PASS": "#2e7d32", "FAIL": "#b3261e", "NO_RESULT": "#757575"}
_STYLES = ("-", "--", ":")
_LONGEST = 34
_ROWS = 7
_BEHIND = {"percentunit": " %", "s": " s", "lengthmm": " mm", "cps": " /s"}
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"))


class Rows(NamedTuple):
    """A statement's answer."""

    columns: list[str]
    rows: list[tuple[Any, ...]]


Answer = list[Series] | Rows
Query = Callable[[Panel, dict[str, Any]], Answer]
"""Queries one of a panel's targets: over time, or once where the panel is a number or a table."""


def draw(board: dict[str, Any], panels: Sequence[Panel], query: Query, file: Path, title: str) -> None:
    """Draw a whole dashboard as one picture.

    Args:
        board: its JSON.
        panels: its panels.
        query: answers them.
        file: the PNG.
        title: above it.
    """
    height = max(each["gridPos"]["y"] + each["gridPos"]["h"] for each in board["panels"])
    with mpl.rc_context({"font.size": 7.5, "axes.titlesize": 8.5, "axes.titleweight": "bold"}):
        figure = Figure(figsize=(24 * _CELL_IN, height * _ROW_IN + 0.6))
        figure.suptitle(title, x=0.01, ha="left", y=1 - 0.1 / (height * _ROW_IN), va="top", fontsize=10)
        scale = height * _ROW_IN / (height * _ROW_IN + 0.6)
        for row in (each for each in board["panels"] if each["type"] == "row"):
            figure.text(
                0.01, scale * (1 - (row["gridPos"]["y"] + 0.7) / height), row["title"], fontsize=9, color="#555555"
            )
        for panel in panels:
            place = panel.data["gridPos"]
            low = place["y"] + place["h"]
            box = (
                (place["x"] + 1.1) / 24, scale * (1 - (low - 1.5) / height),
                (place["w"] - 1.5) / 24, scale * (place["h"] - 2.6) / height,
            )  # fmt: skip
            axes = figure.add_axes(box)
            axes.set_title(panel.title, loc="left")
            answers = [(target, query(panel, target)) for target in panel.targets]
            _DRAWN[panel.data["type"]](axes, panel, answers)
        figure.savefig(file, dpi=80)


def value_of(unit: str, value: float) -> str:
    """A value with its unit, as Grafana would write it, nearly.

    Args:
        unit: Grafana's id.
        value: the number.
    """
    behind = unit.removeprefix("suffix:") if unit.startswith("suffix:") else _BEHIND.get(unit, "")
    if unit == "percentunit":
        value *= 100
    elif unit == "bool_yes_no":
        return "yes" if value else "no"
    elif unit == "s" and value > 2 * 86_400:
        value, behind = value / 86_400, " days"
    elif unit == "s" and value > 2 * 3_600:
        value, behind = value / 3_600, " h"
    elif unit == "bytes":
        value, behind = next(((value / size, f" {name}B") for size, name in _PREFIXES if value >= size), (value, " B"))
    return f"{value:,.4g}{behind}"


def _name(target: dict[str, Any], series: Series) -> str:
    legend = target.get("legendFormat") or ", ".join(
        f"{value}" for key, value in series.labels.items() if key != "__name__"
    )
    text = re.sub(r"\{\{\s*(\w+)\s*\}\}", lambda match: series.labels.get(match[1], ""), legend)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _times(series: Series) -> list[float]:
    return [float(date2num(datetime.fromtimestamp(at_s, UTC))) for at_s, _ in series.points]


def _lines(axes: Axes, panel: Panel, answers: list[tuple[dict[str, Any], Answer]]) -> None:
    custom = panel.data["fieldConfig"]["defaults"].get("custom", {})
    stacked = custom.get("stacking", {}).get("mode") == "normal"
    found = [(_name(target, each), each) for target, answer in answers for each in _series(answer)]
    if stacked:
        _stack(axes, found, bars=custom.get("drawStyle") == "bars")
    else:
        kinds = list(dict.fromkeys(name.partition(", ")[0] for name, _ in found))
        variants = list(dict.fromkeys(name.partition(", ")[2] for name, _ in found))
        for name, each in found:
            kind, _, variant = name.partition(", ")
            color, style = _color(kind, kinds.index(kind)), _STYLES[variants.index(variant) % len(_STYLES)]
            marker = "." if len(each.points) < 3 else ""
            axes.plot(*_with_gaps(each), label=name, color=color, linestyle=style, linewidth=1.0, marker=marker)
    axes.set_ylim(bottom=0)
    _over_time(axes)
    unit = panel.data["fieldConfig"]["defaults"]["unit"]
    if unit.startswith("suffix:"):  # too long to stand beside each number
        axes.set_title(unit.removeprefix("suffix:"), loc="right", fontsize=6.5, fontweight="normal", color="#555555")
        unit = "none"
    elif unit == "bool_yes_no":
        axes.set_yticks((0, 1))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: value_of(unit, value)))
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    if found:
        axes.legend(loc="upper left", fontsize=5.5, ncols=2 if len(found) > 6 else 1, framealpha=0.7)


def _stack(axes: Axes, found: list[tuple[str, Series]], *, bars: bool) -> None:
    """Each series on top of those before; what is missing is nothing."""
    grid = sorted({at for _, each in found for at in _times(each)})
    under = [0.0] * len(grid)
    width = min((b - a for a, b in pairwise(grid)), default=0.02)
    for number, (name, each) in enumerate(found):
        known = dict(zip(_times(each), (value for _, value in each.points), strict=True))
        over = [low + known.get(at, 0.0) for at, low in zip(grid, under, strict=True)]
        if bars:
            heights = [high - low for high, low in zip(over, under, strict=True)]
            axes.bar(grid, heights, 0.8 * width, under, label=name, color=_color(name, number))
        else:
            axes.fill_between(grid, under, over, label=name, color=_color(name, number), alpha=0.7, linewidth=0)
        under = over


def _with_gaps(series: Series) -> tuple[list[float], list[float]]:
    """Times and values; a gap in them stays a gap, as in Grafana."""
    times, values = _times(series), [value for _, value in series.points]
    if len(times) < 3:
        return times, values
    step = min(b - a for a, b in pairwise(times))
    places = [place for place, (a, b) in enumerate(pairwise(times), 1) if b - a > 1.5 * step]
    for place in reversed(places):
        times.insert(place, times[place])
        values.insert(place, float("nan"))
    return times, values


def _over_time(axes: Axes) -> None:
    locator = AutoDateLocator(maxticks=6)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))


def _number(axes: Axes, panel: Panel, answers: list[tuple[dict[str, Any], Answer]]) -> None:
    axes.set_axis_off()
    unit = panel.data["fieldConfig"]["defaults"]["unit"]
    numbers = [
        (_name(target, each), each.points[-1][1])
        for target, answer in answers
        if isinstance(answer, list)
        for each in answer
    ]
    numbers += [(answer.columns[0], float(answer.rows[0][0])) for _, answer in answers if isinstance(answer, Rows)]
    for number, (name, value) in enumerate(numbers):
        x = (number + 0.5) / len(numbers)
        text = name if unit == "none" else value_of(unit, value)
        axes.text(x, 0.55, text, ha="center", va="center", fontsize=13 if len(text) < 12 else 9, color=_COLORS[0])
        axes.text(x, 0.05, "" if unit == "none" else name, ha="center", va="center", fontsize=6.5, color="#555555")


def _table(axes: Axes, panel: Panel, answers: list[tuple[dict[str, Any], Answer]]) -> None:
    axes.set_axis_off()
    unit = panel.data["fieldConfig"]["defaults"]["unit"]
    answer = answers[0][1]
    if isinstance(answer, Rows):
        columns, rows = answer.columns, [[_cell(unit, each) for each in row] for row in answer.rows]
    else:
        columns = [*(key for key in (answer[0] if answer else Series({}, [])).labels if key != "__name__"), "value"]
        rows = [
            [*(each.labels.get(key, "") for key in columns[:-1]), value_of(unit, each.points[-1][1])] for each in answer
        ]
    if not rows:
        axes.text(0.0, 0.9, "no rows: nothing that it asks for", fontsize=6.5, color="#555555", va="top")
        return
    drawn = axes.table(rows[:_ROWS], colLabels=columns, loc="upper center", cellLoc="left", edges="horizontal")
    drawn.auto_set_font_size(value=False)
    drawn.set_fontsize(6.5)
    if len(rows) > _ROWS:
        axes.text(0.0, -0.02, f"and {len(rows) - _ROWS} more", fontsize=6.5, color="#555555", va="top")


def _heat(axes: Axes, _panel: Panel, answers: list[tuple[dict[str, Any], Answer]]) -> None:
    found = sorted(_series(answers[0][1]), key=lambda each: float(each.labels["le"]))
    if not found:
        return
    times = _times(found[0])
    at_most = [dict(zip(_times(each), (value for _, value in each.points), strict=True)) for each in found]
    cells = [
        [max(0.0, upper.get(at, 0.0) - (at_most[row - 1].get(at, 0.0) if row else 0.0)) for at in times]
        for row, upper in enumerate(at_most)
    ]
    drawn = axes.pcolormesh(times, range(len(found)), cells, cmap="YlOrRd", shading="nearest")
    axes.set_yticks(range(len(found)), [each.labels["le"] for each in found], fontsize=5.5)
    axes.set_ylabel("≤ mm²")
    _over_time(axes)
    axes.figure.colorbar(drawn, ax=axes, label="fruit", pad=0.01)


def _series(answer: Answer) -> list[Series]:
    """A statement's rows over time as series: time, metric, value."""
    if not isinstance(answer, Rows):
        return answer
    found: dict[str, list[tuple[float, float]]] = {}
    for at, metric, value in answer.rows:
        found.setdefault(str(metric), []).append((at.timestamp(), float("nan") if value is None else float(value)))
    return [Series({"metric": name}, points) for name, points in found.items()]


def _cell(unit: str, value: Any) -> str:
    if isinstance(value, float):
        return value_of(unit, value)
    if isinstance(value, datetime):
        return f"{value:%Y-%m-%d %H:%M}"
    text = "" if value is None else str(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _color(name: str, number: int) -> str:
    return _OUTCOMES.get(name, _COLORS[number % len(_COLORS)])


_DRAWN = {"timeseries": _lines, "stat": _number, "table": _table, "heatmap": _heat}
