"""Plot of the area curve."""

from collections.abc import Sequence
from io import StringIO
from math import isnan, nan

import matplotlib as mpl
from matplotlib.figure import Figure

from station.inspection.curve import AreaCurve
from station.inspection.monotone import WrongFrame


def curve_svg(
    curve: AreaCurve,
    wrong: Sequence[WrongFrame],
    title: str,
    *,
    changed_mm2: Sequence[float | None],
    lower_bounds: Sequence[int],
) -> str:
    """Plot area over closing in the manner of the paper's Fig. 14, with the changed area of each image.

    Args:
        curve: a curve with at least one point.
        wrong: the points that do not fit the others; they are marked, not moved.
        title: the pressed object and the method.
        changed_mm2: changed area of each point's image; None if the method does not measure it.
        lower_bounds: indices of the points whose contact is at least as large as their area.

    Returns:
        An SVG document that is the same for the same input.
    """
    closing_mm = [point.closing_mm for point in curve.points]
    area_mm2 = [point.reading.area_mm2 for point in curve.points]
    with mpl.rc_context({"svg.hashsalt": "area-curve", "svg.fonttype": "none", "font.size": 10}):
        figure = Figure(figsize=(7.2, 4.0), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(closing_mm, area_mm2, color="#1f4e79", marker="o", markersize=4, linewidth=1.5, label="contact area")
        witness = [nan if changed is None else changed for changed in changed_mm2]
        if not all(map(isnan, witness)):
            axes.plot(closing_mm, witness, color="#8a8a86", linestyle="--", linewidth=1.2, label="changed area")
        if lower_bounds:
            axes.plot(
                [closing_mm[place] for place in lower_bounds],
                [area_mm2[place] for place in lower_bounds],
                color="#1f4e79",
                marker="^",
                markersize=9,
                markerfacecolor="white",
                linestyle="none",
                label="lower bound: the contact is at least this large",
            )
        if wrong:
            axes.plot(
                [closing_mm[frame.index] for frame in wrong],
                [area_mm2[frame.index] for frame in wrong],
                color="#b3261e",
                marker="x",
                markersize=9,
                markeredgewidth=2,
                linestyle="none",
                label="does not fit: a contact cannot shrink while closing",
            )
        if len(axes.get_legend_handles_labels()[1]) > 1:
            axes.legend(loc="lower right", frameon=False)
        axes.axvline(0, color="#888888", linewidth=0.8, linestyle="--")
        axes.annotate(
            f"onset at {curve.onset_mm:g} mm",
            (0, 1),
            xycoords=("data", "axes fraction"),
            xytext=(4, -12),
            textcoords="offset points",
            color="#555555",
        )
        axes.set_xlabel("closing [mm]")
        axes.set_ylabel("area [mm²]")
        axes.set_ylim(bottom=0)
        axes.set_title(title)
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
