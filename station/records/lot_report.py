"""Lot report for people: HTML in one file, or PDF on A4."""

import base64
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import cv2
import jinja2
from fpdf import FPDF
from fpdf.enums import XPos, YPos

from station.records.lot_summary import Example, LotSummary
from station.records.write_requests import utc_ms

_PICTURE_PX = 320
_JPEG_QUALITY = 82
_COLOURS = {"PASS": (91, 127, 149), "FAIL": (179, 38, 30), "NO_RESULT": (201, 162, 39)}
_GREY = (102, 102, 102)
_MARGIN_MM, _WIDTH_MM = 15.0, 180.0


def html_report(lot: LotSummary) -> str:
    """Make an HTML document that needs no network and no other file."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("station.records", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["time"] = _time
    examples = [(example, _data_uri(example)) for example in lot.examples]
    return environment.get_template("lot.html.j2").render(
        lot=lot, examples=examples, tallest=_tallest, made_utc_ms=utc_ms(), version=version("fruit-station")
    )


def pdf_report(lot: LotSummary) -> bytes:
    """Make the same report as PDF on A4."""
    pdf = FPDF(format="A4")
    fonts = files("matplotlib") / "mpl-data" / "fonts" / "ttf"
    for style, name in (("", "DejaVuSans.ttf"), ("B", "DejaVuSans-Bold.ttf")):
        pdf.add_font("DejaVu", style, str(fonts / name))
    pdf.set_margins(_MARGIN_MM, _MARGIN_MM)
    pdf.set_auto_page_break(auto=True, margin=_MARGIN_MM)
    pdf.set_title(f"Lot {lot.name}")
    pdf.add_page()
    _line(pdf, f"Lot {lot.name or 'without a name'}", size=18, bold=True)
    _line(pdf, f"Grower: {lot.grower or 'not told'}; inspections {lot.first} to {lot.last}", grey=True)
    _line(pdf, f"{_time(lot.began_utc_ms)} to {_time(lot.ended_utc_ms)} UTC", grey=True)
    if lot.simulated:
        _line(pdf, f"{lot.simulated} of these inspections were simulated: a twin's device took part.")
    for text in lot.held:
        _line(pdf, f"On hold, {text}")
    pdf.ln(3)
    _line(pdf, f"{lot.total} inspected", size=13, bold=True)
    for outcome, number in lot.outcomes.items():
        pdf.set_fill_color(*_COLOURS[outcome])
        pdf.rect(pdf.l_margin, pdf.get_y() + 1.4, 3, 3, "F")
        pdf.set_x(pdf.l_margin + 5)
        _line(pdf, f"{outcome}: {number} ({100 * lot.share(outcome):.1f} %)")
    _heading(pdf, "Outcomes over the lot")
    _bars(pdf, [dict(zip(lot.outcomes, each, strict=True)) for each in lot.slices], 30, relative=True)
    _heading(pdf, "Contact area that decided")
    if lot.areas:
        _bars(pdf, [{"PASS": passed, "FAIL": failed} for _, passed, failed in lot.areas], 40, relative=False)
        _line(pdf, f"0 to {lot.areas[-1][0]:.0f} mm²; the highest bar is {_tallest(lot.areas)} fruit", grey=True)
    else:
        _line(pdf, "No area was measured.")
    _heading(pdf, "Why not accepted")
    for name, sentence, number in lot.reasons:
        _line(pdf, f"{number} ({100 * number / max(1, lot.total):.2f} %)  {name.replace('_', ' ')}: {sentence}")
    if not lot.reasons:
        _line(pdf, "Nothing was rejected.")
    _heading(pdf, "Recipes")
    for name, revision, sha256, number in lot.recipes:
        _line(pdf, f"{number} inspections with {name}, revision {revision or '-'}, SHA-256 {sha256[:16]}…")
    if lot.examples:
        _heading(pdf, "The last rejected fruit")
        _examples(pdf, lot.examples)
    pdf.ln(4)
    _line(pdf, f"Made {_time(utc_ms())} UTC by fruit-station {version('fruit-station')}", grey=True)
    return bytes(pdf.output())


def _line(pdf: FPDF, text: str, *, size: float = 10, bold: bool = False, grey: bool = False) -> None:
    pdf.set_font("DejaVu", "B" if bold else "", size)
    pdf.set_text_color(*(_GREY if grey else (34, 34, 34)))
    pdf.multi_cell(0, size * 0.55, text, new_x=XPos.LMARGIN, new_y=YPos.NEXT)


def _heading(pdf: FPDF, text: str) -> None:
    pdf.ln(4)
    if pdf.will_page_break(55):
        pdf.add_page()
    _line(pdf, text, size=13, bold=True)
    pdf.ln(1)


def _bars(pdf: FPDF, bars: list[dict[str, int]], height_mm: float, *, relative: bool) -> None:
    """Draw stacked bars from the bottom, PASS first; each relative to its own sum, or all to the highest."""
    width_mm, bottom_mm = _WIDTH_MM / max(1, len(bars)), pdf.get_y() + height_mm
    highest = max((sum(bar.values()) for bar in bars), default=0)
    for index, bar in enumerate(bars):
        top_mm, whole = bottom_mm, sum(bar.values()) if relative else highest
        for outcome, number in bar.items():
            tall_mm = height_mm * number / whole if whole else 0.0
            top_mm -= tall_mm
            pdf.set_fill_color(*_COLOURS[outcome])
            pdf.rect(pdf.l_margin + index * width_mm, top_mm, max(0.2, width_mm - 0.3), tall_mm, "F")
    pdf.set_y(bottom_mm + 2)


def _examples(pdf: FPDF, examples: tuple[Example, ...]) -> None:
    """Write a line for each example, with its picture if there is one."""
    for example in examples:
        picture = _jpeg(example)
        if picture is not None and pdf.will_page_break(28):
            pdf.add_page()
        top_mm = pdf.get_y()
        if picture is not None:
            pdf.image(picture, x=pdf.l_margin, y=top_mm, h=25, keep_aspect_ratio=True)
        area = "" if example.area_mm2 is None else f"{example.area_mm2:.1f} mm², "
        reasons = ", ".join(reason.replace("_", " ") for reason in example.reasons)
        pdf.set_x(pdf.l_margin + (40 if picture is not None else 0))
        _line(pdf, f"{example.sequence}, {_time(example.began_utc_ms)} UTC: {area}{reasons}")
        if picture is not None:
            pdf.set_y(max(pdf.get_y(), top_mm + 27))


def _jpeg(example: Example) -> bytes | None:
    """Return the picture, small; None if there is none that can be read."""
    if example.image is None or (picture := cv2.imread(str(example.image))) is None:
        return None
    share = _PICTURE_PX / max(picture.shape[:2])
    small = cv2.resize(picture, None, fx=share, fy=share, interpolation=cv2.INTER_AREA) if share < 1 else picture
    return cv2.imencode(".jpg", small, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()


def _data_uri(example: Example) -> str:
    picture = _jpeg(example)
    return "" if picture is None else "data:image/jpeg;base64," + base64.b64encode(picture).decode()


def _tallest(areas: tuple[tuple[float, int, int], ...]) -> int:
    return max((passed + failed for _, passed, failed in areas), default=0)


def _time(utc_milliseconds: int) -> str:
    return datetime.fromtimestamp(utc_milliseconds / 1000, UTC).strftime("%Y-%m-%d %H:%M")


WAYS = {".html": lambda lot: html_report(lot).encode(), ".pdf": pdf_report}


def write_report(lot: LotSummary, target: Path) -> None:
    """Write a report, HTML or PDF by the file's suffix.

    Args:
        target: with one of the suffixes in `WAYS`; replaced.

    Raises:
        OSError: it cannot be written.
    """
    target.write_bytes(WAYS[target.suffix](lot))
