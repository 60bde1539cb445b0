"""The catalogues: nothing is missing in a language, and numbers are written as it writes them."""

import json
import re
import xml.etree.ElementTree as ET
from string import Formatter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmi import charts
from hmi.navigation import entries, parts
from hmi.words import FOLDER, NO_VALUE, Wording, catalogue, preferred
from station.channel.panel_live import CurveShown, Fruit, FruitShort, LimitShown, OrderName
from station.inspection.alarm_table import ALARMS
from station.inspection.alarms import AlarmState
from station.inspection.states import STATES
from station.vocabulary import OutcomeName, PackmlState, Reason

HMI = FOLDER.parent
LANGUAGES = ("en", "de", "es")
STATIONS_OWN = "station"
"""The catalogue of what the station says in English itself."""
IN_TEMPLATES = re.compile(r"""\bt\(\s*["']([a-z_]+\.[a-zA-Z_.-]+)["'](?=\s*[,)])""")
IN_CODE = re.compile(r"""(?:text\(|Problem\(\d+, |PeopleError\()["']([a-z_]+\.[a-z_]+)["']""")


def fields(text):
    return sorted(name for _, name, _, _ in Formatter().parse(text) if name)


def test_every_language_says_everything():
    english = catalogue("en")
    for language in ("de", "es"):
        other = {key: text for key, text in catalogue(language).items() if not key.startswith(f"{STATIONS_OWN}.")}
        assert sorted(other) == sorted(english), language
        for key, text in other.items():
            assert text.strip(), key
            assert fields(text) == fields(english[key]), key


def test_every_file_is_there_in_every_language():
    names = {path.name for path in (FOLDER / "de").iterdir()}
    assert names == {path.name for path in (FOLDER / "es").iterdir()}
    assert names - {f"{STATIONS_OWN}.json"} == {path.name for path in (FOLDER / "en").iterdir()}


@pytest.mark.parametrize("language", ["de", "es"])
def test_what_the_station_says_in_english_is_said_in_every_language(language):
    own = {key for key in catalogue(language) if key.startswith(f"{STATIONS_OWN}.")}
    wanted = {f"station.{what}.{alarm}" for what in ("cause", "consequence", "action") for alarm in ALARMS}
    assert own == wanted | {f"station.state.{state}" for state in STATES}


def test_no_text_that_a_page_uses_is_missing():
    used = set()
    for pattern, files in ((IN_TEMPLATES, HMI.rglob("*.j2")), (IN_CODE, HMI.rglob("*.py"))):
        for path in files:
            used |= set(pattern.findall(path.read_text(encoding="utf-8")))
    used |= {f"reason.{reason}" for reason in Reason} | {f"packml.{state}" for state in PackmlState}
    used |= {f"order.{order}" for order in OrderName} | {f"alarms.state.{state}" for state in AlarmState}
    used |= {f"nav.{entry.name}" for entry in entries()}
    assert used <= set(catalogue("en")), used - set(catalogue("en"))
    assert len(used) > 100


def test_every_part_is_somewhere():
    templates = "".join(path.read_text(encoding="utf-8") for path in HMI.rglob("*.j2"))
    for name in parts():
        assert f'live("{name}")' in templates, name


def test_catalogues_are_sorted_by_page():
    for path in FOLDER.glob("*/*.json"):
        for key in json.loads(path.read_text(encoding="utf-8")):
            assert key.startswith(f"{path.stem}."), (path, key)


@pytest.mark.parametrize(
    ("language", "value", "digits", "text"),
    [
        ("en", 1234.5, 1, "1\u202f234.5"),
        ("de", 1234.5, 1, "1\u202f234,5"),
        ("es", 0.25, 2, "0,25"),
        ("de", None, 1, NO_VALUE),
        ("de", -3.0, 0, "-3"),
    ],
)
def test_numbers_are_written_as_the_language_does(language, value, digits, text):
    assert Wording(language).number(value, digits) == text


def test_a_percentage_and_a_date():
    assert Wording("de").percent(0.375, 1) == "37,5\u00a0%"
    assert Wording("en").percent(0.375) == "38%"
    assert re.fullmatch(r"\d\d\.\d\d\.\d{4}", Wording("de").day(1_700_000_000_000))


@given(st.text(max_size=60), st.text(max_size=60))
def test_any_header_gives_a_language(cookie, accepted):
    assert preferred(("de", "en"), cookie, accepted) in {"de", "en"}


def test_the_browsers_wish_counts_after_the_persons():
    assert preferred(("en", "de", "es"), "", "fr-FR, es-MX;q=0.9, en;q=0.8") == "es"
    assert preferred(("en", "de", "es"), "de", "es") == "de"
    assert preferred(("de", "en"), "es", "fr") == "de"


@given(st.floats(0.01, 1e4))
def test_an_axis_reaches_its_largest_value_with_few_round_numbers(largest):
    ticks = charts.ticks(largest)
    assert ticks[0] == 0
    assert largest <= ticks[-1] * (1 + 1e-6)
    assert 2 <= len(ticks) <= 12


def fruit(outcome: OutcomeName = "FAIL", areas: tuple[float, ...] = (1.0, 20.5, 60.0)) -> Fruit:
    short = FruitShort(
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
        curve=tuple(CurveShown(closing_mm=float(n), area_mm2=a, flagged=n == 0) for n, a in enumerate(areas)),
        limits=(LimitShown(closing_mm=3.0, area_mm2=45.0, least_area_mm2=10.0),),
        early_stop_mm2=50.0,
        growth_mm2_per_mm=20.0,
        deadline_s=100.0,
        phases_s={},
        picture_step=2,
    )


@pytest.mark.parametrize("areas", [(), (5.0,), (1.0, 20.5, 60.0)])
def test_a_curve_is_drawn_with_every_point_and_limit(areas):
    drawn = ET.fromstring(charts.curve(fruit(areas=areas), Wording("de")))
    circles = [each for each in drawn.iter() if each.tag.endswith("circle")]
    assert len(circles) == len(areas)
    assert drawn.get("role") == "img"
    assert "60,0" in drawn.attrib["aria-label"]
    assert all(0 <= float(each.attrib["cy"]) <= charts.HEIGHT for each in circles)


def test_a_trend_counts_tens():
    outcomes: list[OutcomeName] = ["PASS", "PASS", "FAIL", "FAIL", "NO_RESULT"]
    outcomes += [outcomes[0]] * 19
    many = [fruit(outcome).short for outcome in outcomes]
    drawn = ET.fromstring(charts.trend(many, Wording("en")))
    assert drawn.attrib["aria-label"].endswith("0, 3")
    ET.fromstring(charts.sketch(()))


def test_nothing_is_fetched_from_outside():
    for path in [*(HMI / "templates").iterdir(), *(HMI / "static").iterdir()]:
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?://|//[a-z]+\.", text), path
        assert " style=" not in text, path
