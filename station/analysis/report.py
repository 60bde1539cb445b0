"""Analysis report: one HTML file with its pictures inside."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
from markupsafe import Markup

from station.charts.area_chart import style
from station.charts.report import data_uri, templates
from station.vision.contact import Image

_JPEG_QUALITY = 88


@dataclass(frozen=True, slots=True)
class ReportRow:
    """One measured image in the report."""

    image: str
    picture: str
    """A data URI."""
    mask: str
    """The mask's path, relative to the report."""
    contact: bool
    area_px: int
    area_mm2: float
    lower_bound: bool
    """The contact is at least this large."""
    changed_area_mm2: float | None
    """Changed area of the image; None if the method does not measure it."""
    width_mm: float | None
    press: int | None
    """Number of its press, from 1; None unless there are several."""
    closing_mm: float | None
    confidence: float | None
    flags: Sequence[str]
    notes: Sequence[str]


@dataclass(frozen=True, slots=True)
class Report:
    """Content of the report."""

    title: str
    facts: Sequence[tuple[str, str]]
    """Names and values of the measurement's settings."""
    rows: Sequence[ReportRow]
    errors: Sequence[tuple[str, str]]
    curve: Markup | None
    no_onset: bool
    """True if there are widths, and no contact was found: there is no curve."""
    stages: Sequence[tuple[str, str]]
    """The stages' sheets: the file beside the report, and a data URI."""
    quality: str | None
    """The mean of the denoising's figures in a sentence."""


def render(report: Report) -> str:
    """Make an HTML document that needs no network and no other file."""
    return templates("station.analysis").get_template("report.html.j2").render(report=report, chart_style=style())


def jpeg_uri(picture: Image) -> str:
    """Return a picture, shape (height, width, 3), dtype uint8, as the data URI of a JPEG."""
    data = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()
    return data_uri(data)
