"""A calibration's and a verification's numbers as pictures."""

from collections.abc import Sequence
from io import BytesIO

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from station.calibration.model import Calibration, FieldMap, PressPoint

_BLUE, _RED, _GREY = "#1f4e79", "#b3261e", "#888888"


def area_plot(calibration: Calibration, now: Sequence[PressPoint] | None = None) -> bytes:
    """The ball's area over the gripper's width, as the paper plots it; a verification's beside it.

    Args:
        calibration: its curve is drawn.
        now: a verification's curve; None for none.

    Returns:
        A PNG file.
    """
    figure, axes = _axes()
    _draw(axes, calibration.curve, _BLUE, "calibration", calibration.mm_per_px)
    if now is not None:
        _draw(axes, now, _RED, "now", calibration.mm_per_px)
    axes.axvline(calibration.onset_mm, color=_GREY, linewidth=0.8, linestyle="--")
    axes.text(calibration.onset_mm, 0.98, " onset", color="#555555", transform=axes.get_xaxis_transform(), va="top")
    axes.invert_xaxis()
    axes.set_xlabel("width between the fingers [mm]")
    axes.set_ylabel("contact area [mm²]")
    axes.set_ylim(bottom=0)
    axes.grid(color="#dddddd", linewidth=0.6)
    axes.legend(loc="upper left", frameon=False)
    return _png(figure)


def field_plot(field: FieldMap) -> bytes:
    """Light and noise over the field.

    Args:
        field: the map.

    Returns:
        A PNG file.
    """
    figure = Figure(figsize=(7.2, 3.4), layout="constrained")
    light = np.asarray(field.light_levels).reshape(field.rows, field.columns, 3)
    noise = np.asarray(field.noise_levels).reshape(field.rows, field.columns)
    maps = [(light[..., index], f"light, {name}") for index, name in enumerate(("blue", "green", "red"))]
    for number, (values, title) in enumerate([*maps, (noise, "noise")], start=1):
        axes = figure.add_subplot(1, 4, number)
        shown = axes.imshow(values, cmap="viridis", vmin=0)
        axes.set_title(title, fontsize=9)
        axes.set_xticks([])
        axes.set_yticks([])
        bar = figure.colorbar(shown, ax=axes, orientation="horizontal", pad=0.03)
        bar.ax.tick_params(labelsize=7)
    figure.supxlabel("grey levels", fontsize=8)
    return _png(figure)


def _draw(axes, curve: Sequence[PressPoint], colour: str, label: str, mm_per_px: float) -> None:  # noqa: ANN001 (matplotlib's)
    widths = [point.width_mm for point in curve]
    areas = [point.area_px * mm_per_px**2 for point in curve]
    axes.plot(widths, areas, color=colour, marker="o", markersize=4, linewidth=1.5, label=label)
    doubted = [index for index, point in enumerate(curve) if point.cut or (point.confidence or 0.0) < 0.5]
    if doubted:
        axes.plot(
            [widths[index] for index in doubted],
            [areas[index] for index in doubted],
            color=colour,
            marker="o",
            markerfacecolor="white",
            markersize=7,
            linestyle="none",
            label=f"{label}: cut by the border, or not sure",
        )


def _axes():  # noqa: ANN202 (matplotlib's)
    with mpl.rc_context({"font.size": 10}):
        figure = Figure(figsize=(7.2, 3.8), layout="constrained")
        axes = figure.add_subplot()
        axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _png(figure: Figure) -> bytes:
    data = BytesIO()
    figure.savefig(data, format="png", dpi=110)
    return data.getvalue()
