"""One run of `station analyze`: images in, the folder of results out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from station.analysis.decoding import Decoded
from station.analysis.measurement import Measured, Refused, measure_all
from station.analysis.output import OutputFolder, flag_names
from station.analysis.pictures import outlined, sheet, stacked, thumbnail
from station.analysis.report import Report, ReportRow, data_uri, render
from station.analysis.sources import Source
from station.calibration.model import Calibration
from station.errors import BadInputError
from station.inspection.curve import Reading, area_curve
from station.inspection.monotone import wrong_frames
from station.settings.segmentation import Segmentation
from station.vision.contact import Contact, Flag, Image
from station.vision.methods import make_method
from station.vision.quality import DenoisingQuality, denoising_quality
from station.vision.scale import Scale

_THUMBNAIL_PX = 220
_STAGE_PX = 150
_COLUMNS = 10
_NO_MASK = np.zeros((0, 0), np.uint8)


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be measured, how, and where the results go."""

    sources: Sequence[Source]
    references: Sequence[Decoded]
    reference_name: str
    segmentation: Segmentation
    recipe: str | None
    widths_mm: dict[str, float] | None
    """The measured width by the image's name, or None where no table was given."""
    out: Path
    stages: bool
    jobs: int
    calibration: Calibration | None = None
    """Of the unit that took the images; None where it is not known."""


@dataclass(slots=True)
class _Gathered:
    """What the report needs of each image, small enough to keep for all of them."""

    rows: list[ReportRow] = field(default_factory=list)
    thumbnails: list[tuple[str, list[Image]]] = field(default_factory=list)
    stages: list[tuple[str, list[Image]]] = field(default_factory=list)
    stage_names: tuple[str, ...] = ()
    qualities: list[tuple[str, DenoisingQuality]] = field(default_factory=list)
    details: list[tuple[str, Contact]] = field(default_factory=list)
    """Without their masks: those lie on the disk."""
    readings: list[tuple[str, Reading]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a run."""

    measured: int
    touched: int
    """In how many of them anything touches the gel."""
    refused: Sequence[Refused]


def analyze(request: Request, on_done: Callable[[], None]) -> Outcome:
    """Measure all images and write tables, masks, pictures and the report.

    Args:
        request: what, how and where.
        on_done: called after each image.

    Raises:
        BadInputError: the widths do not fit the images, or the folder cannot be written; what is measured by then
            is kept.
    """
    _check_widths(request)
    references = [decoded.image for decoded in request.references]
    shape = references[0].shape
    scale = _scale(request.calibration, shape[0], shape[1])
    gathered = _Gathered()
    refused: list[Refused] = []
    with OutputFolder(request.out) as output:
        for item in measure_all(
            request.sources,
            shape,
            lambda: make_method(references, request.segmentation),
            jobs=request.jobs,
            stages=request.stages,
        ):
            if isinstance(item, Refused):
                refused.append(item)
            else:
                area_mm2, _ = scale.area_mm2(item.contact.area_px)
                output.add(item, area_mm2)
                output.add_stages(item)
                _gather(gathered, item, area_mm2, request.widths_mm)
            on_done()
        if gathered.rows:
            _write_summaries(output, request, gathered, refused, scale)
    return Outcome(len(gathered.rows), sum(row.contact for row in gathered.rows), refused)


def _check_widths(request: Request) -> None:
    if request.widths_mm is None:
        return
    measurable = (source.name for source in request.sources if not source.refused)
    missing = [name for name in measurable if name not in request.widths_mm]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise BadInputError(f"--widths: no width for {', '.join(missing[:3])}{more}; add a row for each image")


def _gather(gathered: _Gathered, item: Measured, area_mm2: float, widths_mm: dict[str, float] | None) -> None:
    name = item.source.name
    picture = thumbnail(outlined(item.image, item.contact.mask), _THUMBNAIL_PX)
    width_mm = widths_mm[name] if widths_mm is not None else None
    unknown = Flag.UNDECIDED in item.contact.flags
    gathered.rows.append(
        ReportRow(
            image=name,
            picture=data_uri(picture),
            mask=f"masks/{item.source.stem}.png",
            contact=item.contact.found,
            area_px=item.contact.area_px,
            area_mm2=area_mm2,
            width_mm=width_mm,
            closing_mm=None,
            confidence=item.contact.confidence,
            flags=flag_names(item),
            notes=item.conversions,
        )
    )
    gathered.details.append((name, replace(item.contact, mask=_NO_MASK)))
    area = "area unknown" if unknown else f"{area_mm2:.2f} mm2"
    gathered.thumbnails.append((f"{name}\n{area}", [picture]))
    if width_mm is not None and not unknown:
        gathered.readings.append((name, Reading(width_mm, item.contact.area_px, area_mm2, item.contact.is_firm)))
    if item.stages:
        gathered.stage_names = tuple(item.stages)
        gathered.stages.append((name, [thumbnail(stage, _STAGE_PX) for stage in item.stages.values()]))
        gathered.qualities.append((name, _quality(item)))


def _quality(item: Measured) -> DenoisingQuality:
    """Compare the denoised stage with the one before it."""
    names = list(item.stages)
    denoised = names.index("denoised")
    return denoising_quality(item.stages[names[denoised - 1]], item.stages["denoised"])


def _write_summaries(
    output: OutputFolder, request: Request, gathered: _Gathered, refused: Sequence[Refused], scale: Scale
) -> None:
    output.write_errors(refused)
    if any(contact.confidence is not None for _, contact in gathered.details):
        output.write_details(gathered.details)
    for name, picture in _pages("contact_sheet", gathered.thumbnails, 4):
        output.write_picture(name, picture)
    stages_pictures: list[tuple[str, str]] = []
    for name, picture in _pages("stages", gathered.stages, 1, gathered.stage_names):
        output.write_picture(name, picture)
        stages_pictures.append((name, data_uri(picture)))
    if gathered.qualities:
        output.write_denoising(gathered.qualities)
    svg, rows = _write_curve(output, request, gathered)
    report = Report(
        title=f"Contact areas of {len(gathered.rows)} images",
        facts=_facts(request, scale),
        rows=rows,
        errors=[(item.source.name, item.reason) for item in refused],
        curve_svg=svg,
        stages=stages_pictures,
        no_onset=request.widths_mm is not None and svg is None,
        quality=_mean_quality(gathered.qualities),
    )
    output.write_bytes("report.html", render(report).encode())


def _write_curve(output: OutputFolder, request: Request, gathered: _Gathered) -> tuple[str | None, list[ReportRow]]:
    """Write the curve where there are widths, and put the closings into the report's rows."""
    from station.analysis.plots import curve_svg  # noqa: PLC0415 (matplotlib takes a second to load; few runs draw)

    curve = area_curve(reading for _, reading in gathered.readings)
    if not curve.points:
        return None, gathered.rows
    names = {id(reading): name for name, reading in gathered.readings}
    images = [names[id(point.reading)] for point in curve.points]
    points = [point.reading for point in curve.points]
    wrong = wrong_frames([reading.width_mm for reading in points], [reading.area_mm2 for reading in points])
    output.write_curve(images, curve, wrong)
    svg = curve_svg(curve, wrong, f"{request.recipe or 'press'}, method {request.segmentation.method}")
    output.write_bytes("curve.svg", svg.encode())
    closing_mm = dict(zip(images, (point.closing_mm for point in curve.points), strict=True))
    unfit = {images[frame.index] for frame in wrong}
    return svg, [
        _on_curve(row, closing_mm[row.image], unfit) if row.image in closing_mm else row for row in gathered.rows
    ]


def _on_curve(row: ReportRow, closing_mm: float, unfit: set[str]) -> ReportRow:
    flags = [*row.flags, "area_does_not_fit_the_other_steps"] if row.image in unfit else row.flags
    return replace(row, closing_mm=closing_mm, flags=flags)


def _scale(calibration: Calibration | None, height_px: int, width_px: int) -> Scale:
    """The scale of images of the whole field, by the unit's calibration or as is typical."""
    if calibration is None:
        return Scale.typical(height_px, width_px)
    smaller = max(calibration.height_px, calibration.width_px) / max(height_px, width_px)
    return Scale(calibration.mm_per_px * smaller, calibration.scale_uncertainty)


def _facts(request: Request, scale: Scale) -> list[tuple[str, str]]:
    count = len(request.references)
    converted = sorted({text for decoded in request.references for text in decoded.conversions})
    known = request.calibration
    whose = "typical" if known is None else f"calibration {known.id} of {known.serial}"
    parameters = request.segmentation.paper if request.segmentation.method == "paper" else request.segmentation.robust
    return [
        ("Method", request.segmentation.method),
        ("Parameters", ", ".join(f"{name} {value}" for name, value in parameters.model_dump().items())),
        ("Recipe", request.recipe or "none: the method's defaults"),
        (
            "Reference",
            "; ".join([request.reference_name + (f", median of {count} images" if count > 1 else ""), *converted]),
        ),
        ("Scale", f"{scale.mm_per_px:.4f} mm per pixel, {whose}: areas in mm² are good to {2 * scale.uncertainty:.0%}"),
        ("Program", f"fruit-station {version('fruit-station')}"),
    ]


def _mean_quality(qualities: Sequence[tuple[str, DenoisingQuality]]) -> str | None:
    if not qualities:
        return None
    psnr_db = float(np.mean([quality.psnr_db for _, quality in qualities]))
    mse = float(np.mean([quality.mse for _, quality in qualities]))
    ssim = float(np.mean([quality.ssim for _, quality in qualities]))
    return f"PSNR {psnr_db:.2f} dB, MSE {mse:.1f}, SSIM {ssim:.3f}"


def _pages(
    name: str, columns: Sequence[tuple[str, Sequence[Image]]], sheets: int, row_names: Sequence[str] = ()
) -> Iterator[tuple[str, Image]]:
    """Pictures of so many sheets each, with their files' names: NAME.png, then NAME_2.png and so on."""
    for page, start in enumerate(range(0, len(columns), sheets * _COLUMNS), start=1):
        part = columns[start : start + sheets * _COLUMNS]
        rows = [sheet(part[first : first + _COLUMNS], row_names) for first in range(0, len(part), _COLUMNS)]
        yield f"{name}.png" if page == 1 else f"{name}_{page}.png", stacked(rows)
