"""The run page's charts: every point and limit of the curve, and the trend of diverted fruit."""

import re
import xml.etree.ElementTree as ET

import pytest

from hmi.run import charts
from hmi.run.routes import MOST_RECENT, fruit_values
from hmi.web.translation import Locale
from station.channel.panel_run import CurvePointSummary, Fruit, FruitSummary, LimitView
from station.vocabulary import OutcomeName


def fruit(outcome: OutcomeName = "FAIL", areas: tuple[float, ...] = (1.0, 20.5, 60.0)) -> Fruit:
    short = FruitSummary(
        sequence=7,
        outcome=outcome,
        reasons=("area_over_limit",),
        ended_utc_ms=1_700_000_000_000,
        duration_ms=8000,
        recipe="blueberry",
        lot="<L>",
        area_mm2=60.0,
        closing_mm=2.0,
        areas_mm2=areas,
    )
    return Fruit(
        short=short,
        explanation=(),
        recipe_title="Blueberry",
        revision="1",
        onset_mm=15.0,
        curve=tuple(CurvePointSummary(closing_mm=float(n), area_mm2=a, flagged=n == 0) for n, a in enumerate(areas)),
        limits=(LimitView(closing_mm=3.0, area_mm2=45.0, least_area_mm2=10.0),),
        growth_mm2_per_mm=20.0,
        deadline_s=100.0,
        phases_s={},
        picture_step=2,
    )


@pytest.mark.parametrize("areas", [(), (5.0,), (1.0, 20.5, 60.0)])
def test_a_curve_is_drawn_with_every_point_and_limit(areas):
    drawn = ET.fromstring(charts.curve(fruit(areas=areas), Locale("de")))
    every = [each for each in drawn.iter() if each.tag.endswith("circle")]
    circles = [each for each in every if each.get("class") != "mark-decided"]
    assert len(circles) == len(areas)
    assert len(every) - len(circles) == (len(areas) == 3), "the one at 2 mm decided"
    assert drawn.get("role") == "img"
    assert [each.get("class") for each in circles] == ["mark-doubtful", "mark-point", "mark-point"][: len(areas)]
    assert "60,0" in drawn.attrib["aria-label"]
    assert all(0 <= float(each.attrib["cy"]) <= 176 for each in circles)


def test_a_trend_counts_tens():
    outcomes: list[OutcomeName] = ["PASS", "PASS", "FAIL", "FAIL", "NO_RESULT"]
    outcomes.extend(outcomes[0] for _ in range(19))
    many = [fruit(outcome).short for outcome in outcomes]
    drawn = ET.fromstring(charts.trend(many, Locale("en")))
    assert drawn.attrib["aria-label"].endswith("0, 3")


def test_fruit_of_one_number_have_pictures_of_their_own(pages):
    """A browser keeps a picture for ever, and numbers begin at 1 again when the records are removed."""

    def picture(ended_utc_ms):
        shown = fruit()
        shown = shown.model_copy(update={"short": shown.short.model_copy(update={"ended_utc_ms": ended_utc_ms})})
        values = {**fruit_values(shown, Locale("en")), "on_run": True, "never_inspected": False}
        return re.findall('src="([^"]+)"', pages.context.renderer.render("run_fruit.html.j2", Locale("en"), values))

    assert picture(1_700_000_000_000) != picture(1_700_000_000_001)
    assert picture(1_700_000_000_000) == picture(1_700_000_000_000) != []


def test_the_latest_fruit_are_announced_as_many_as_are_shown(pages):
    assert f'aria-label="The last {MOST_RECENT} fruit"'.encode() in pages("GET", "/")[2]
