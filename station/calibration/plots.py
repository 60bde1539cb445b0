"""Plots of a calibration's and a verification's figures."""

from collections.abc import Sequence

import numpy as np

from station.calibration.checks import LEAST_CONFIDENCE
from station.calibration.model import Calibration, FieldMap, PressPoint
from station.charts.report import png

_BLUE, _RED, _GREY = "#1f4e79", "#b3261e", "#888888"


def area_plot(calibration: Calibration, now: Sequence[PressPoint] | None = None) -> bytes:
    """Plot the ball's area over the gripper's width, as the paper does, and a verification's curve, as a PNG file."""
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
    figure.legend(loc="outside upper center", ncols=2, frameon=False, fontsize=8)
    return png(figure)


def field_plot(field: FieldMap) -> bytes:
    """Plot light and noise over the field, as a PNG file."""
    figure = _figure(3.4)
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
    return png(figure)


def _draw(axes, curve: Sequence[PressPoint], colour: str, label: str, mm_per_px: float) -> None:  # noqa: ANN001 (matplotlib's)
    """Join certain points; draw uncertain ones, and a contact that was lost again, as single points."""
    first = next((index for index, point in enumerate(curve) if point.area_px), len(curve))
    sure, doubted = [], []
    for index, point in enumerate(curve):
        lost = index > first and not point.area_px
        doubtful = point.cut or lost or (point.confidence is not None and point.confidence < LEAST_CONFIDENCE)
        (doubted if doubtful else sure).append((point.width_mm, point.area_px * mm_per_px**2))
    if sure:
        axes.plot(*zip(*sure, strict=True), color=colour, marker="o", markersize=4, linewidth=1.5, label=label)
    if doubted:
        hollow = f"{label}: not sure, lost or cut by the border"
        axes.plot(
            *zip(*doubted, strict=True),
            color=colour,
            marker="o",
            markerfacecolor="white",
            markersize=7,
            linestyle="none",
            label=hollow,
        )


# The plots' library is a third of what a process would load at its start, for pages that are made once a shift.
def _figure(height_in: float):  # noqa: ANN202 (matplotlib's)
    from matplotlib.figure import Figure  # noqa: PLC0415

    return Figure(figsize=(7.2, height_in), layout="constrained")


def _axes():  # noqa: ANN202 (matplotlib's)
    from matplotlib import rc_context  # noqa: PLC0415

    with rc_context({"font.size": 10}):
        figure = _figure(3.8)
        axes = figure.add_subplot()
        axes.spines[["top", "right"]].set_visible(False)
    return figure, axes
