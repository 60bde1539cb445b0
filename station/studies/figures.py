"""Figures of a study, in the manner of the paper's; each takes one study, or two to compare."""

from collections.abc import Sequence
from io import BytesIO

import cv2
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from station.analysis.stages import StagedMethod
from station.charts.report import png
from station.studies.cohort import member
from station.studies.failure import image_at
from station.studies.sample import SampleResult, segmentation_of
from station.studies.study import Study
from station.twin.gel import MM_PER_PX
from station.vision.median import median_image
from station.vision.methods import make_method
from station.vision.press import PressTracker

_MM2 = MM_PER_PX**2
_GOOD, _BAD, _TRUTH, _QUIET = "#1f4e79", "#b3261e", "#222222", "#8a8a86"
_SHOWN = ("image", "amplified", "difference", "denoised", "segmented")
"""Stages of a method; an amplified difference, if there is one, replaces the difference."""
_COLUMNS = 8
_DPI = 110


def press_sheet(study: Study, number: int) -> bytes:
    """Draw one press's images: original, difference, denoised, and segmented with the true edge (cf. its Fig. 13).

    The sample is counted from 1, and the picture is a JPEG.
    """
    request = study.request
    press = member(request.kind, request.seed, number - 1).press()
    segmentation = segmentation_of(request.fruit, request.method)
    method = StagedMethod(make_method(median_image(press.references), segmentation))
    tracker = PressTracker(method)
    places = _spread(press.closings_mm)
    columns: list[dict[str, npt.NDArray[np.uint8]]] = []
    for place, frame in enumerate(press.frames):  # all of them, since each step is measured with the one before
        tracker.measure_step([frame])
        if place in places:
            stages = {"image": frame, **method.pictures}
            if "amplified" in stages:
                del stages["difference"]
            columns.append(stages)
    rows = [name for name in _SHOWN if name in columns[0]]
    figure = Figure(figsize=(1.25 * len(places), 1.68 * len(rows) + 0.35), layout="constrained")
    axes = np.asarray(figure.subplots(len(rows), len(places), squeeze=False))
    for column, (place, stages) in enumerate(zip(places, columns, strict=True)):
        for row, name in enumerate(rows):
            axis: Axes = axes[row, column]
            axis.imshow(_small(stages[name]), interpolation="nearest")
            axis.set(xticks=[], yticks=[])
            axis.spines[:].set_color("#d5d5d0")
            if name == "segmented" and press.true_masks[place].any():
                axis.contour(_small(press.true_masks[place])[..., 0], [127], colors=[_BAD], linewidths=1.0)
            if not column:
                axis.set_ylabel(name, fontsize=9)
        axes[0, column].set_title(f"{press.closings_mm[place]:.1f} mm", fontsize=9)
    data = BytesIO()
    figure.savefig(data, format="jpeg", dpi=_DPI, pil_kwargs={"quality": 82})
    return data.getvalue()


def one_curve(studies: Sequence[Study], number: int) -> bytes:
    """Plot area over closing of a sample, from 1, of one or two studies with the truth (cf. its Fig. 14); a PNG."""
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    axis = figure.add_subplot()
    truth = studies[0].samples[number - 1]
    axis.plot(truth.closings_mm, _mm2(truth.true_areas_px), color=_TRUTH, linewidth=1, linestyle="--", label="truth")
    for study, colour, marker in zip(studies, (_BAD if len(studies) > 1 else _GOOD, _GOOD), "so", strict=False):
        sample = study.samples[number - 1]
        name = study.request.method
        axis.plot(sample.closings_mm, _mm2(sample.areas_px), color=colour, marker=marker, markersize=4, label=name)
    _dress(axis, studies[0])
    axis.legend(frameon=False, loc="upper left")
    return png(figure)


def cohort_curves(studies: Sequence[Study]) -> bytes:
    """Plot area over closing of the samples that did not fail, and did (cf. its Figs. 21 to 32), a row a study; PNG."""
    figure = Figure(figsize=(10.0, 3.3 * len(studies)), layout="constrained")
    axes = np.asarray(figure.subplots(len(studies), 2, squeeze=False, sharex=True, sharey=True))
    for row, study in zip(axes, studies, strict=True):
        for axis, failed in zip(row, (False, True), strict=True):
            those = [s for s, causes in zip(study.samples, study.causes, strict=True) if bool(causes) == failed]
            for sample in those:
                axis.plot(
                    sample.closings_mm,
                    _mm2(sample.areas_px),
                    color=_BAD if failed else _GOOD,
                    linewidth=0.9,
                    alpha=max(0.15, min(0.8, 12 / max(1, len(those)))),
                )
            _dress(axis, study)
            axis.set_title(
                f"{study.request.method}: {len(those)} of {len(study.samples)} samples "
                f"{'failed' if failed else 'did not fail'}",
                fontsize=10,
            )
    highest = max(float(_mm2(sample.areas_px).max()) for study in studies for sample in study.samples)
    axes[0, 0].set_ylim(0, 1.05 * max(1.0, highest))
    for axis in axes[:-1].flat:
        axis.set_xlabel("")
    for axis in axes[:, 1]:
        axis.set_ylabel("")
    return png(figure)


def areas_at_results(studies: Sequence[Study]) -> bytes:
    """Plot measured over true area of every sample at the results' closings, a row for each study; a PNG."""
    closings = studies[0].result_closings_mm
    shown = [closings[0], closings[len(closings) // 2], closings[-1]]
    figure = Figure(figsize=(10.0, 3.4 * len(studies)), layout="constrained")
    axes = np.asarray(figure.subplots(len(studies), len(shown), squeeze=False))
    for row, study in zip(axes, studies, strict=True):
        for axis, closing_mm in zip(row, shown, strict=True):
            _scatter(axis, study, closing_mm)
        row[0].set_ylabel(f"{study.request.method}: measured [mm²]")
    for axis in axes[-1]:
        axis.set_xlabel("true area [mm²]")
    return png(figure)


def _scatter(axis: Axes, study: Study, closing_mm: float) -> None:
    for sample, causes in zip(study.samples, study.causes, strict=True):
        place = image_at(sample.closings_mm, [closing_mm])[0]
        axis.plot(
            sample.true_areas_px[place] * _MM2,
            sample.areas_px[place] * _MM2,
            color=_BAD if causes else _GOOD,
            marker="x" if causes else "o",
            markersize=4,
            alpha=0.7,
            linestyle="none",
        )
    top = 1.05 * max(axis.get_xlim()[1], axis.get_ylim()[1])
    axis.plot([0, top], [0, top], color=_TRUTH, linewidth=0.8, linestyle="--")
    axis.fill_between([0, top], [0, 0.5 * top], [0, 1.5 * top], color="#888888", alpha=0.10, linewidth=0)
    axis.set(xlim=(0, top), ylim=(0, top))
    axis.set_title(f"{closing_mm:g} mm of closing", fontsize=10)
    _grid(axis)


def _dress(axis: Axes, study: Study) -> None:
    """Draw labels, the contact onset and the results' closings."""
    axis.axvline(0, color=_QUIET, linewidth=0.8, linestyle="--")
    if len(study.result_closings_mm) <= 4:
        for closing_mm in study.result_closings_mm:
            axis.axvline(closing_mm, color="#c9a227", linewidth=0.8, linestyle=":")
    axis.set_xlabel("closing [mm]")
    axis.set_ylabel("contact area [mm²]")
    axis.set_ylim(bottom=0)
    _grid(axis)


def _grid(axis: Axes) -> None:
    axis.grid(color="#e2e2de", linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)


def _spread(closings_mm: Sequence[float]) -> list[int]:
    """Return the last image before the contact and seven after it, evenly."""
    touching = [place for place, closing in enumerate(closings_mm) if closing > 0]
    chosen = np.linspace(0, len(touching) - 1, min(_COLUMNS - 1, len(touching))).round().astype(int)
    return [max(0, touching[0] - 1), *(touching[place] for place in chosen)]


def _small(picture: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Shrink a picture to a quarter of the sensor's size, in RGB."""
    size = (120, 160)
    small = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    return np.asarray(cv2.cvtColor(small, cv2.COLOR_GRAY2RGB if small.ndim == 2 else cv2.COLOR_BGR2RGB), np.uint8)


def _mm2(areas_px: Sequence[int]) -> npt.NDArray[np.float64]:
    return np.asarray(areas_px, float) * _MM2


def typical(study: Study, *, failed: bool) -> SampleResult | None:
    """Return the sample of median width among those that failed, or did not; None if there is none."""
    those = [s for s, causes in zip(study.samples, study.causes, strict=True) if bool(causes) == failed]
    return sorted(those, key=lambda sample: sample.width_mm)[len(those) // 2] if those else None
