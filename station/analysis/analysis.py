"""Analysis run of `station analyze`: images in, the folder of results out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
from markupsafe import Markup

from station.analysis.curve_chart import curve_chart
from station.analysis.decoding import Decoded
from station.analysis.measurement import Measured, Refused, measure_all
from station.analysis.output import OutputFolder, flag_names
from station.analysis.pictures import outlined, sheet, stacked, thumbnail
from station.analysis.press_curve import PressCurve, Step, press_curve
from station.analysis.presses import Run, runs, singles
from station.analysis.report import Report, ReportRow, jpeg_uri, render
from station.analysis.sources import Source
from station.calibration.model import Calibration
from station.charts.area_chart import document
from station.errors import BadInputError
from station.inspection.curve import Reading
from station.settings.segmentation import Segmentation
from station.vision.contact import Contact, Image
from station.vision.median import median_image
from station.vision.methods import make_method
from station.vision.quality import DenoisingQuality, denoising_quality
from station.vision.scale import TYPICAL_MM_PER_PX, TYPICAL_UNCERTAINTY, Scale
from station.vocabulary import Flag

_THUMBNAIL_PX = 220
_STAGE_PX = 150
_COLUMNS = 10
_NO_MASK = np.zeros((0, 0), np.uint8)
_LOWER_BOUNDS = {Flag.CUT_BY_BORDER, Flag.LOWER_BOUND}


@dataclass(frozen=True, slots=True)
class Request:
    """Images, method and result folder of an analysis."""

    sources: Sequence[Source]
    references: Sequence[Decoded]
    reference_name: str
    segmentation: Segmentation
    recipe: str | None
    widths_mm: dict[str, float] | None
    """The measured width by the image's name, or None without a table."""
    out: Path
    stages: bool
    jobs: int
    calibration: Calibration | None = None
    """Of the unit that took the images; None if unknown."""
    sequence: bool = False
    """The images are the steps of one press, in the order given."""
    site_mm_per_px: float = TYPICAL_MM_PER_PX
    """Scale of the site's camera, for a unit whose calibration has not measured it."""


@dataclass(frozen=True, slots=True)
class _Summary:
    """Report data of one image, small enough to keep for all images."""

    number: int
    """In the order given by the user, from 0."""
    row: ReportRow
    contact: Contact
    """Without its mask, which is on the disk, and without the data for the next step."""
    caption: str
    thumbnail: Image
    reading: Reading | None
    """None without widths, and if the area is unknown."""
    stages: dict[str, Image]
    """Their thumbnails by name; empty if not requested."""
    quality: DenoisingQuality | None


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of a run."""

    measured: int
    touched: int
    """Number of images with a contact."""
    refused: Sequence[Refused]


def analyze(request: Request, on_done: Callable[[], None]) -> Outcome:
    """Measure all images and write tables, masks, pictures and the report; `on_done` is called after each image.

    Raises:
        BadInputError: the widths do not fit the images, or the folder cannot be written; results measured by then
            are kept.
    """
    _check_widths(request)
    reference = median_image([decoded.image for decoded in request.references])
    shape = reference.shape
    scale = _scale(request, shape[0], shape[1])
    order = _order(request)
    found: dict[int, _Summary | Refused] = {}
    with OutputFolder(request.out) as output:
        for item in measure_all(
            request.sources,
            order,
            shape,
            lambda: make_method(reference, request.segmentation),
            jobs=request.jobs,
            stages=request.stages,
        ):
            if isinstance(item, Refused):
                output.skip(item)
                found[item.number] = item
            else:
                output.add(item, scale.area_mm2(item.contact.area_px)[0])
                output.add_stages(item)
                found[item.number] = _summary(item, scale, request.widths_mm)
            on_done()
        given = [found[number] for number in sorted(found)]
        measured = [item for item in given if isinstance(item, _Summary)]
        refused = [item for item in given if isinstance(item, Refused)]
        if measured:
            _write_summaries(output, request, measured, refused, scale, order)
    return Outcome(len(measured), sum(item.row.contact for item in measured), refused)


def _order(request: Request) -> list[Run]:
    """Return the presses; `paper` measures every image by itself, as printed, so its images need no order."""
    if request.segmentation.method == "paper":
        return singles(request.sources)
    return runs(request.sources, request.widths_mm, sequence=request.sequence)


def _check_widths(request: Request) -> None:
    if request.widths_mm is None:
        return
    measurable = (source.name for source in request.sources if not source.refused)
    missing = [name for name in measurable if name not in request.widths_mm]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        raise BadInputError(f"--widths: no width for {', '.join(missing[:3])}{more}; add a row for each image")


def _summary(item: Measured, scale: Scale, widths_mm: dict[str, float] | None) -> _Summary:
    name, contact = item.source.name, item.contact
    area_mm2, _ = scale.area_mm2(contact.area_px)
    changed_mm2 = None if contact.changed_area_px is None else scale.area_mm2(contact.changed_area_px)[0]
    picture = thumbnail(outlined(item.image, contact.mask), _THUMBNAIL_PX)
    width_mm = widths_mm[name] if widths_mm is not None else None
    unknown = Flag.UNDECIDED in contact.flags
    known_at_mm = None if unknown else width_mm
    bound = "at least " if contact.found and contact.flags & _LOWER_BOUNDS else ""
    return _Summary(
        number=item.number,
        row=ReportRow(
            image=name,
            picture=jpeg_uri(picture),
            mask=f"masks/{item.source.stem}.png",
            contact=contact.found,
            area_px=contact.area_px,
            area_mm2=area_mm2,
            lower_bound=bool(bound),
            changed_area_mm2=changed_mm2,
            width_mm=width_mm,
            press=None,
            closing_mm=None,
            confidence=contact.confidence,
            flags=flag_names(item),
            notes=item.conversions,
        ),
        contact=replace(contact, mask=_NO_MASK, trace=None),
        caption=f"{name}\n" + ("area unknown" if unknown else f"{bound}{area_mm2:.2f} mm2"),
        thumbnail=picture,
        reading=None if known_at_mm is None else Reading(known_at_mm, contact.area_px, area_mm2, contact.is_firm),
        stages={stage: thumbnail(shown, _STAGE_PX) for stage, shown in item.stages.items()},
        quality=_quality(item) if item.stages else None,
    )


def _quality(item: Measured) -> DenoisingQuality:
    """Compare the denoised stage with the one before it."""
    names = list(item.stages)
    denoised = names.index("denoised")
    return denoising_quality(item.stages[names[denoised - 1]], item.stages["denoised"])


def _write_summaries(
    output: OutputFolder,
    request: Request,
    measured: Sequence[_Summary],
    refused: Sequence[Refused],
    scale: Scale,
    order: Sequence[Run],
) -> None:
    output.write_errors(refused)
    if any(item.contact.confidence is not None for item in measured):
        output.write_details([(item.row.image, item.contact) for item in measured])
    for name, picture in _pages("contact_sheet", [(item.caption, [item.thumbnail]) for item in measured], 4):
        output.write_picture(name, picture)
    stages_pictures: list[tuple[str, str]] = []
    staged = [(item.row.image, list(item.stages.values())) for item in measured if item.stages]
    for name, picture in _pages("stages", staged, 1, tuple(measured[0].stages)):
        output.write_picture(name, picture)
        stages_pictures.append((name, jpeg_uri(picture)))
    qualities = [(item.row.image, item.quality) for item in measured if item.quality is not None]
    if qualities:
        output.write_denoising(qualities)
    chart, rows = _write_curves(output, request, measured)
    report = Report(
        title=f"Contact areas of {len(measured)} images",
        facts=_facts(request, scale, order),
        rows=rows,
        errors=[(item.source.name, item.reason) for item in refused],
        curve=chart,
        stages=stages_pictures,
        no_onset=request.widths_mm is not None and chart is None,
        quality=_mean_quality(qualities),
    )
    output.write_bytes("report.html", render(report).encode())


def _write_curves(
    output: OutputFolder, request: Request, measured: Sequence[_Summary]
) -> tuple[Markup | None, list[ReportRow]]:
    """Write the presses' curves if there are widths, and add presses and closings to the report's rows."""
    rows = {item.number: item.row for item in measured}
    if request.widths_mm is None:
        return None, list(rows.values())
    # By `paper` too, which measures images by themselves: an onset is a press's own.
    order = runs(request.sources, request.widths_mm, sequence=request.sequence)
    presses = [run for run in order if run.followed]
    if len(presses) > 1:
        for press, run in enumerate(presses, start=1):
            rows |= {number: replace(rows[number], press=press) for number in run.numbers if number in rows}
    readings = {item.number: item.reading for item in measured}
    curves = [
        press_curve(press, [Step(rows[n], reading) for n in run.numbers if (reading := readings.get(n)) is not None])
        for press, run in enumerate(presses, start=1)
    ]
    if not any(each.curve.points for each in curves):
        return None, list(rows.values())
    output.write_curves(curves)
    chart = curve_chart(curves, f"{request.recipe or 'press'}, method {request.segmentation.method}")
    output.write_bytes("curve.svg", document(chart).encode())
    on_curve = {row.image: row for each in curves for row in _on_curve(each)}
    return chart, [on_curve.get(row.image, row) for row in rows.values()]


def _on_curve(press: PressCurve) -> Iterator[ReportRow]:
    unfit = {frame.index for frame in press.wrong}
    for place, (row, point) in enumerate(zip(press.rows, press.curve.points, strict=True)):
        flags = [*row.flags, "area_does_not_fit_the_other_steps"] if place in unfit else row.flags
        yield replace(row, closing_mm=point.closing_mm, flags=flags)


def _scale(request: Request, height_px: int, width_px: int) -> Scale:
    """Return the scale of images of the whole field: the one that the station measures the unit by, else the typical.

    A calibration at one place has measured no scale.
    """
    calibration = request.calibration
    if calibration is None:
        return Scale.typical(height_px, width_px)
    smaller = max(calibration.height_px, calibration.width_px) / max(height_px, width_px)
    if not calibration.scale_measured:
        return Scale(request.site_mm_per_px * smaller, TYPICAL_UNCERTAINTY)
    return Scale(calibration.mm_per_px * smaller, calibration.scale_uncertainty)


def _facts(request: Request, scale: Scale, order: Sequence[Run]) -> list[tuple[str, str]]:
    count = len(request.references)
    converted = sorted({text for decoded in request.references for text in decoded.conversions})
    known = request.calibration
    whose = "typical" if known is None else f"calibration {known.id} of {known.serial}"
    if known is not None and not known.scale_measured:
        whose = f"not measured by {whose}"
    parameters = request.segmentation.paper if request.segmentation.method == "paper" else request.segmentation.robust
    return [
        ("Method", request.segmentation.method),
        ("Parameters", ", ".join(f"{name} {value}" for name, value in parameters.model_dump().items())),
        ("Recipe", request.recipe or "none: the method's defaults"),
        ("Measured as", _describe_presses(order)),
        (
            "Reference",
            "; ".join([request.reference_name + (f", median of {count} images" if count > 1 else ""), *converted]),
        ),
        ("Scale", f"{scale.mm_per_px:.4f} mm per pixel, {whose}: areas in mm² are good to {2 * scale.uncertainty:.0%}"),
        ("Program", f"fruit-station {version('fruit-station')}"),
    ]


def _describe_presses(order: Sequence[Run]) -> str:
    steps = [len(run.numbers) for run in order if run.followed]
    alone = sum(not run.followed for run in order)
    pressed = f"{len(steps)} {'press' if len(steps) == 1 else 'presses'} of {', '.join(map(str, steps))} images"
    return "; ".join([*([pressed] if steps else []), *([f"{alone} images, each by itself"] if alone else [])])


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
    """Split pictures into files of so many sheets each: NAME.png, then NAME_2.png and so on."""
    for page, start in enumerate(range(0, len(columns), sheets * _COLUMNS), start=1):
        part = columns[start : start + sheets * _COLUMNS]
        rows = [sheet(part[first : first + _COLUMNS], row_names) for first in range(0, len(part), _COLUMNS)]
        yield f"{name}.png" if page == 1 else f"{name}_{page}.png", stacked(rows)
