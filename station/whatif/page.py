"""Report of a what-if: one HTML file with its pictures inside, readable without network and station."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from markupsafe import Markup
from sqlalchemy import Connection

from station.calibration.gate import gated
from station.calibration.gel import outlined
from station.charts.area_chart import Curve, Limit, Size, Texts, area_chart, report_style
from station.charts.report import data_uri, templates
from station.inspection.press import Press
from station.inspection.sized_limits import sized_limits
from station.recipe_store.difference import Difference
from station.records.images import image_path
from station.settings.recipe_model import Recipe
from station.settings.segmentation import Segmentation
from station.vision.contact import Contact, Image
from station.vision.methods import make_method
from station.vision.press import PressTracker
from station.whatif.against_marks import Compared
from station.whatif.outcome_table import AFTER, BEFORE, Counted
from station.whatif.replay import Replayed
from station.whatif.stored import StoredPress, read_stored

MOST_SHOWN = 60
_CHART = Size(300, 200, 12)
_PICTURE_PX = 150
_ORANGE = (0, 140, 255)
"""Blue, green, red."""


@dataclass(frozen=True, slots=True)
class FruitView:
    """View of one fruit."""

    result: Replayed
    chart: Markup
    """Area over closing, with the limits at the time of the inspection and the draft's, for the fruit's size."""
    picture: str
    """A data URI of its last image with the contact's outline; empty if none was stored."""


@dataclass(frozen=True, slots=True)
class Page:
    """Content of the report."""

    title: str
    facts: Sequence[tuple[str, str]]
    changes: Sequence[Difference] | str
    """What the draft changes of the recipe of all fruit, or a text with the reason why it is not known."""
    counted: Counted
    against: Compared | None
    """Comparison with people's marks; None if no fruit is marked."""
    shown: Sequence[FruitView]
    changed: int
    """Number of fruit that change sides, shown or not."""


def render(page: Page) -> str:
    """Make the HTML document."""
    template = templates("station.whatif").get_template("whatif.html.j2")
    return template.render(page=page, before=BEFORE, after=AFTER, report_style=report_style())


def fruit_views(
    connection: Connection,
    folder: Path,
    results: Sequence[Replayed],
    recipes: Mapping[str, Recipe | None],
    draft: Recipe,
) -> list[FruitView]:
    """Read the views of some fruit, in the page's order.

    Args:
        recipes: that they were judged by, by their hash; None for one that this program does not accept any more.
    """
    stored = read_stored(connection, [result.sequence for result in results], folder, with_images=False)
    limits = {each.sequence: _limits(each.press, recipes[each.recipe_sha256], draft) for each in stored}
    by_sequence = {each.sequence: each for each in stored}
    # One that is not stored was removed by housekeeping meanwhile.
    return [
        _fruit_view(
            connection, folder, result, by_sequence.get(result.sequence), limits.get(result.sequence, []), draft
        )
        for result in results
    ]


def _limits(press: Press, own: Recipe | None, draft: Recipe) -> list[Limit]:
    """Return a recipe's area limits and the draft's, each for the fruit's size."""
    both = [(draft, False)] if own is None else [(own, True), (draft, False)]
    return [
        Limit(each.closing_mm, each.area_mm2, former=former)
        for recipe, former in both
        for each in sized_limits(press, recipe).recipe.damage.area
    ]


def _fruit_view(
    connection: Connection,
    folder: Path,
    result: Replayed,
    stored: StoredPress | None,
    limits: Sequence[Limit],
    draft: Recipe,
) -> FruitView:
    points = stored.press.points if stored else ()
    curves = [Curve("own", [(point.closing_mm, point.area_mm2) for point in points])]
    if result.areas_mm2:
        again = zip(points, result.areas_mm2, strict=False)
        curves.append(Curve("again", [(point.closing_mm, area) for point, area in again]))
    chart = area_chart(curves, limits, Texts(f"Area over closing of inspection {result.sequence}"), size=_CHART)
    measuring = gated(draft.segmentation, stored.gate_factor) if stored and result.areas_mm2 else None
    return FruitView(result, chart, _picture(connection, folder, result.sequence, measuring))


def _picture(connection: Connection, folder: Path, sequence: int, draft: Segmentation | None) -> str:
    """Return the last step's image, with its stored outline if the mask was stored, and the draft's if it measures."""
    rows = connection.exec_driver_sql(
        "SELECT kind, step, sha256 FROM images WHERE sequence = ? ORDER BY step, id",
        (sequence,),
    ).all()
    step = max((row[1] for row in rows if row[0] == "step"), default=None)
    wanted = ((kind, sha256) for kind, of_step, sha256 in rows if of_step == step or kind == "reference")
    found = {kind: _image(folder, sha256) for kind, sha256 in wanted}
    image, mask, reference = found.get("step"), found.get("mask"), found.get("reference")
    if image is None:
        return ""
    by_draft = None
    if draft is not None and reference is not None:
        before = [_image(folder, sha256) for kind, of_step, sha256 in rows if kind == "step" and of_step != step]
        by_draft = _followed(reference, [*before, image], draft)
    if mask is not None and mask.shape[:2] == image.shape[:2]:
        image = outlined(image, mask[:, :, 0])
    if by_draft is not None:
        image = outlined(image, by_draft.mask, _ORANGE)
    scale = _PICTURE_PX / image.shape[0]
    small = cv2.resize(image, (round(scale * image.shape[1]), _PICTURE_PX), interpolation=cv2.INTER_AREA)
    data = cv2.imencode(".jpg", small, (cv2.IMWRITE_JPEG_QUALITY, 85))[1].tobytes()
    return data_uri(data)


def _followed(reference: Image, steps: Sequence[Image | None], segmentation: Segmentation) -> Contact | None:
    """Measure the last step's contact as the last of its press; None if an image is not stored any more."""
    tracker = PressTracker(make_method(reference, segmentation))
    contact = None
    for image in steps:
        if image is None:
            return None
        contact = tracker.measure_step([image])
    return contact


def _image(folder: Path, sha256: str) -> Image | None:
    try:
        data = Path(image_path(folder, sha256)).read_bytes()
    except OSError:
        return None
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if image is None else np.asarray(image, np.uint8)


def as_json(counted: Counted, against: Compared | None) -> str:
    """Return the figures of all results, and of the marked fruit, if any, as a file."""
    figures = {**counted.summary(), "marked": None if against is None else against.figures()}
    return json.dumps(figures, indent=2, ensure_ascii=False) + "\n"
