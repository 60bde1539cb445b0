"""Plots of a gauge study, as in AIAG's MSA."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from station.charts.report import png
from station.studies.gauge import SPREAD, Gauge
from station.studies.gauge_table import Crossed

_COLOURS = ("#1f4e79", "#c9791b", "#2e7d5b", "#7b3f8c", "#8c6d1f", "#3f7f8c")
_MARKERS = "os^Dvp"
_D4 = {2: 3.267, 3: 2.574, 4: 2.282, 5: 2.114, 6: 2.004, 7: 1.924, 8: 1.864, 9: 1.816, 10: 1.777}
"""Upper limit of the mean range, by the number of repeats (AIAG's SPC, 2nd edition, appendix E)."""


def components_plot(gauge: Gauge) -> bytes:
    """Plot bars of each kind of variation, against the total and the tolerance, as a PNG."""
    shown = [one for one in gauge.components if one.name != "TV"]
    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    axis = figure.add_subplot()
    places = np.arange(len(shown))
    series = [("% of the total variation", [one.study_percent for one in shown])]
    if gauge.tolerance is not None:
        series.append(
            (f"% of the tolerance ({SPREAD:g} standard deviations)", [one.tolerance_percent or 0.0 for one in shown])
        )
    width = 0.8 / len(series)
    for number, (name, values) in enumerate(series):
        bars = axis.bar(
            places + (number - (len(series) - 1) / 2) * width, values, width, color=_COLOURS[number], label=name
        )
        axis.bar_label(bars, fmt="%.0f", fontsize=9)
    for limit in (10, 30):
        axis.axhline(limit, color="#8a8a86", linewidth=0.8, linestyle="--")
    axis.set_xticks(places, [one.name for one in shown])
    axis.set_ylabel("%")
    axis.legend(frameon=False)
    _plain(axis)
    return png(figure)


def measurements_plot(table: Crossed) -> bytes:
    """Plot every measurement by part, the operators' means by part, and the ranges of the repeats, as a PNG."""
    figure = Figure(figsize=(10.0, 7.4), layout="constrained")
    by_part, means, ranges = (figure.add_subplot(3, 1, row) for row in (1, 2, 3))
    values, places = table.areas_mm2, np.arange(len(table.parts))
    operators = len(table.operators)
    for number, operator in enumerate(table.operators):
        colour, marker = _COLOURS[number % len(_COLOURS)], _MARKERS[number % len(_MARKERS)]
        shift = (number - (operators - 1) / 2) * min(0.18, 0.7 / operators)
        repeats = values.shape[2]
        by_part.plot(
            np.repeat(places + shift, repeats),
            values[:, number].ravel(),
            color=colour,
            marker=marker,
            markersize=4,
            alpha=0.75,
            linestyle="none",
            label=f"operator {operator}",
        )
        means.plot(places, values[:, number].mean(axis=1), color=colour, marker=marker, markersize=5, linewidth=1.2)
        spans = np.ptp(values[:, number], axis=1)
        ranges.plot(places + shift, spans, color=colour, marker=marker, markersize=5, linestyle="none")
    if values.shape[2] in _D4:
        mean_range = float(np.ptp(values, axis=2).mean())
        ranges.axhline(mean_range, color="#8a8a86", linewidth=0.8)
        ranges.axhline(_D4[values.shape[2]] * mean_range, color="#b3261e", linewidth=0.8, linestyle="--")
    for axis, title in (
        (by_part, "every measurement"),
        (means, "means of the operators: parallel lines mean no interaction"),
        (ranges, "range of the repeats, its mean, and its upper control limit (dashed)"),
    ):
        axis.set_title(title, fontsize=10)
        axis.set_xticks(places, table.parts)
        axis.set_ylabel("area [mm²]")
        axis.set_ylim(bottom=0)
        _plain(axis)
    ranges.set_xlabel("part")
    by_part.legend(frameon=False, ncols=operators, loc="upper left", bbox_to_anchor=(0, 1.32))
    return png(figure)


def _plain(axis: Axes) -> None:
    axis.grid(color="#e2e2de", linewidth=0.6, axis="y")
    axis.set_axisbelow(True)
    axis.spines[["top", "right"]].set_visible(False)
