"""Lot report for people: one HTML file, laid out for the screen and for A4."""

from datetime import UTC, datetime
from importlib.metadata import version

import cv2

from station.charts.area_chart import report_style
from station.charts.area_histogram import area_histogram
from station.charts.report import data_uri, templates
from station.charts.spark import spark
from station.clock import utc_ms
from station.records.lot_summary import Example, LotSummary

SUFFIX = ".html"
_PICTURE_PX = 320
_JPEG_QUALITY = 82


def html_report(lot: LotSummary, station: str) -> str:
    """Make an HTML document that needs no network and no other file; each printed page names station and lot."""
    environment = templates("station.records")
    environment.filters["time"] = _time
    environment.filters["css"] = _css
    examples = [(example, _data_uri(example), spark(example.areas_mm2, 200, 44)) for example in lot.examples]
    return environment.get_template("lot.html.j2").render(
        lot=lot,
        station=station,
        examples=examples,
        histogram=area_histogram(lot.areas, lot.limits),
        made_utc_ms=utc_ms(),
        version=version("fruit-station"),
        report_style=report_style(),
    )


def _css(text: str) -> str:
    """Return a text for a quoted CSS string: all but ASCII letters and digits escaped, as names come from outside."""
    return "".join(sign if sign.isascii() and sign.isalnum() else f"\\{ord(sign):06x}" for sign in text)


def _data_uri(example: Example) -> str:
    """Return the picture, small; empty if there is none that can be read."""
    if example.image is None or (picture := cv2.imread(str(example.image))) is None:
        return ""
    share = _PICTURE_PX / max(picture.shape[:2])
    small = cv2.resize(picture, None, fx=share, fy=share, interpolation=cv2.INTER_AREA) if share < 1 else picture
    data = cv2.imencode(".jpg", small, (cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY))[1].tobytes()
    return data_uri(data)


def _time(utc_milliseconds: int) -> str:
    return datetime.fromtimestamp(utc_milliseconds / 1000, UTC).strftime("%Y-%m-%d %H:%M")
