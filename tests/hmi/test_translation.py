"""Texts, numbers and dates in the language of the page."""

import ast
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from string import Formatter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmi import charts
from hmi.navigation import entries, modules, parts
from hmi.recipe_form import groups
from hmi.texts import texts
from hmi.translation import FOLDER, NO_VALUE, Locale, catalogue, page_translations, preferred, translations
from station.channel.panel_live import CurvePointSummary, Fruit, FruitSummary, LimitView, OperatorCommandName
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import FrameFault
from station.devices.gripper.errors import GripperError, GripperFaultError
from station.inspection.alarm_table import ALARMS
from station.inspection.alarms import AlarmState
from station.inspection.states import STATES
from station.messages import commands, lots, outbox, recipes
from station.settings.hmi import LANGUAGES
from station.settings.recipe import load_recipes
from station.vision.contact import Flag
from station.vocabulary import OutcomeName, PackmlState, Reason

HMI = FOLDER.parent
STATION = HMI.parent / "station"
FAULTS_FROM = (
    *(
        f"devices/arm/{name}"
        for name in ("process_handle", "dashboard", "diagnosis", "faults", "link", "messages", "process", "ur")
    ),
    *(f"devices/gripper/{name}" for name in ("calibration", "errors", "modbus_rtu", "robotiq", "urcap")),
    *(f"devices/camera/{name}" for name in ("digit", "feed")),
    *(
        f"service/{name}"
        for name in (
            "bare_grip",
            "device_manager",
            "grip",
            "reference",
            "device_monitor",
        )
    ),
)
"""Where what is wrong with a device, and so an alarm's detail or why fruit are refused, is put into words."""
NO_FAULTS = {
    "the arm's process",
    "the arm's link",
    "words of the arm's process",
    "get robot model",
    "get serial number",
    "unlock protective stop",
    "close safety popup",
    "already in use",
    "could not connect",
    "the protective stop",
    "URCap at {}:{}",
    "UR10e at {}",
    "is in remote control",
    "{} is {}; expected 0 to 15",
    "its light cannot be set colour by colour: write firmware {} or newer to it",  # of `devices check` alone
    "it refused its light's setting: unplug it and plug it in again",
    "Modbus RTU unit {} at {}",
    "Robotiq 2F-85 by {}",
    "watch of the {}",
}
"""Names, what is asked on the wire or looked for in an answer, and what a setting is refused with."""
COMPOSED = {
    "sentence.stopped_area": ("No further step was made at {} mm of closing", ": the area, {} mm², is over the early"),
    "sentence.stopped_growth": (
        "No further step was made at {} mm of closing",
        ": the area grows by {} mm² a millimetre,",
    ),
    "sentence.area_near": ("The area {} is {}: it is not surely within the limit.", "{} ± {} mm²; {}"),
    "sentence.area_and_limit": ("The area at {} mm of closing is {}.", "{} ± {} mm²; {}"),
    "sentence.growth_near": ("closing the area grows by {} ± {} mm² a millimetre, ", "which may be "),
    "sentence.growth_over": ("closing the area grows by {} ± {} mm² a millimetre, ", "over the limit of {}."),
}
"""What the station puts together of several."""
NO_PAGES = {
    "/live",
    "/fruit/{sequence}/picture.svg",
    "/history/image/{sha256}.png",
    "/history/{sequence}/step/{step}/stage/{place}.jpg",
    "/maintenance/health/part",
    "/maintenance/image/part",
    "/maintenance/image/{place}.jpg",
    "/maintenance/registers/part",
    "/maintenance/log/part",
    "/maintenance/sensor/part",
    "/maintenance/sensor/{kind}/{name}",
    "/recipes/{name}/chart",
    "/recipes/{name}/export",
    "/jobs/{job}/part",
    "/jobs/{job}/file/{name}",
    "/jobs/{job}/show/{name}",
}
"""Parts of pages, pictures, streams and files."""
IN_THEIR_OWN_TESTS = {"/alarms/{alarm}", "/jobs/{job}"}
IN_TEMPLATES = re.compile(r"""\bt\(\s*["']([a-z_]+\.[a-zA-Z_.-]+)["'](?=\s*[,)])""")
IN_CODE = re.compile(r"""(?:text\(|Problem\(\d+, |UserStoreError\()["']([a-z_]+\.[a-z_]+)["']""")


def fields(text):
    return sorted(name for _, name, _, _ in Formatter().parse(text) if name)


def test_every_language_has_the_stations_sentences():
    english = catalogue("en")
    for language in LANGUAGES[1:]:
        other = {key: text for key, text in catalogue(language).items() if not key.startswith("station.")}
        assert sorted(other) == sorted(english), language
        for key, text in other.items():
            assert text.strip(), key
            assert fields(text) == fields(english[key]), key


def sentences(path):
    """The sentences of a module that somebody is told, with {} for what they are filled with."""
    tree, skipped = ast.parse(path.read_text(encoding="utf-8")), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):  # a docstring
            skipped.add(node.value)
        if isinstance(node, ast.JoinedStr):
            skipped |= {each for part in node.values for each in ast.walk(part)}
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith((".post", "log.info", "log.warning")):
            skipped |= {each for value in node.args for each in ast.walk(value)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in skipped:
            yield node.value
        elif isinstance(node, ast.JoinedStr) and node not in skipped:
            yield "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)


def anonymous(text):
    return "".join(literal + ("{}" if name else "") for literal, name, _, _ in Formatter().parse(text))


@pytest.mark.parametrize("module", FAULTS_FROM)
def test_every_fault_of_a_device_is_said_in_every_language(module):
    known = {anonymous(text) for key, text in catalogue("en").items() if key.startswith("sentence.")}
    told = {text for text in sentences(STATION / f"{module}.py") if len(text.split()) > 2 and text != text.upper()}
    assert told - NO_FAULTS <= known


def test_every_sentence_to_translate_is_one_that_the_station_says():
    """A sentence that was changed there would go on in English, unnoticed."""
    told = {text for path in STATION.rglob("*.py") for text in sentences(path)}
    for key, text in catalogue("en").items():
        pieces = COMPOSED.get(key, (anonymous(text),))
        if key.startswith("sentence.") and not key.startswith("sentence.expect_"):
            assert all(any(piece in each for each in told) for piece in pieces), key


@pytest.mark.parametrize(
    ("language", "english", "said"),
    [
        ("es", "The area at 3.0 mm of closing is at least 61.2 mm²; the limit is 45 mm²: it is over the limit.",
         "El área a 3,0 mm de cierre es de al menos 61,2 mm²; el límite es 45 mm²: está por encima del límite."),
        ("de", "The area at 3 mm of closing is 131.0 ± 7.2 mm²; the limit for a strawberry of 48 mm is 117.4 mm².",
         "Die Fläche bei 3 mm Schließweg ist 131,0 ± 7,2 mm²; die Grenze für strawberry von 48 mm ist 117,4 mm²."),
        ("es", "The PLC gave a length of 26.0 mm, and the fruit is 35.0 mm wide: that is another fruit's size.",
         "El PLC indicó una longitud de 26,0 mm, y la fruta mide 35,0 mm de ancho: ese es el tamaño de otra fruta."),
        ("de", "the <arm> is away", '<span lang="en">the &lt;arm&gt; is away</span>'),
        ("de", "", ""),
    ],
)  # fmt: skip
def test_what_the_station_says_is_said_in_the_language_of_the_page(language, english, said):
    assert Locale(language).sentence(english) == said


@pytest.mark.parametrize(
    ("language", "message", "said"),
    [
        ("en", commands.BUSY(), "an inspection is under way: wait for its end"),
        ("de", commands.BUSY(), "eine Prüfung läuft: ihr Ende abwarten"),
        ("es", commands.TOO_SLOW(command="reset", limit_s=2.5, activity=commands.BUSY_CALL_OFF()),
         "reset no terminó en 2,5 s: hay una inspección en curso: cancélela primero"),
        ("es", lots.REFUSED(lot="B-7", why=recipes.GONE(recipe="blueberry", number=2)),
         "El lote B-7 no puede empezar: la receta blueberry con el número de PLC 2 ya no está en vigor; "  # noqa: ISC004
         "elija de nuevo."),
        ("de", outbox.WAITING(destination="mqtt", number=1, age_s=9.0), "mqtt: 1 Eintrag wartet, seit 9 s"),
        ("de", outbox.WAITING(destination="mqtt", number=2, age_s=9.0), "mqtt: 2 Einträge warten, seit 9 s"),
    ],
)  # fmt: skip
def test_a_message_is_said_in_the_language_of_the_page(language, message, said):
    assert Locale(language).sentence(message) == said


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_every_alarm_and_state_is_said_in_every_language(language):
    told = translations(language)
    for row in ALARMS.values():
        assert {row.cause.id, row.consequence.id, row.action.id} <= told.keys()
    assert {facts.reason.id for facts in STATES.values()} - {"text.sentences"} <= told.keys()


@pytest.mark.parametrize(
    ("language", "fault", "what", "remedy"),
    [
        ("de", ArmFault(ArmCause.PROTECTIVE_STOP, "the arm is in a protective stop"), "Arm: der Arm ist im Schutzhalt",
         ". Herausfinden, warum der Arm hielt, seinen Weg frei machen, dann den Schutzhalt bestätigen."),
        ("es", GripperFaultError(0xD), "Pinza: su activación falló (fallo 0x0D, activation_fault)",
         "; busque qué bloquea los dedos, despeje los dedos y active de nuevo la pinza"),
        ("de", GripperError("its reset did not end in time: it stands at count 7, with no motion asked for", "look"),
         "Greifer: sein Rücksetzen endete nicht rechtzeitig: er steht bei Zähler 7, ohne dass eine Bewegung verlangt "  # noqa: ISC004
         "war",
         "; look"),
        ("de", "camera left: no frame newer than asked for within 2.5 s; the newest is 9.25 s old. "  # noqa: ISC004
         "Check its cable and its light, then `station devices check`",
         "Kamera left: in 2,5 s kein neues Bild; das neueste ist 9,25 s alt",
         ". Kabel und Licht prüfen, dann `station devices check`"),
    ],
)  # fmt: skip
def test_a_fault_is_said_whole_with_what_to_do(language, fault, what, remedy):
    assert Locale(language).sentence(str(fault)) == what + remedy


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_value_of_a_recipe_is_explained_in_every_language(language):
    made = groups(load_recipes()["strawberry"].model_dump(mode="json"))
    for field in (field for group in made for field in group.fields):
        assert "lang=" not in Locale(language).sentence(field.expected), field.path
        for key, english in ((field.key, field.title), (field.key.replace("field", "what", 1), field.description)):
            assert language == "en" or key in page_translations(language)
            assert Locale(language).own(key, english)


def test_no_text_that_a_page_uses_is_missing():
    used = set()
    for pattern, files in ((IN_TEMPLATES, HMI.rglob("*.j2")), (IN_CODE, HMI.rglob("*.py"))):
        for path in files:
            used |= set(pattern.findall(path.read_text(encoding="utf-8")))
    used |= {f"reason.{reason}" for reason in Reason} | {f"packml.{state}" for state in PackmlState}
    used |= {f"order.{order}" for order in OperatorCommandName} | {f"alarms.state.{state}" for state in AlarmState}
    used |= {f"nav.{entry.name}" for entry in entries()}
    used |= {f"inspection.flag_{flag}" for flag in Flag} | {f"maintenance.fault_{fault}" for fault in FrameFault}
    assert used <= set(texts()), used - set(texts())
    assert len(used) > 100


def test_every_part_is_somewhere():
    templates = "".join(path.read_text(encoding="utf-8") for path in HMI.rglob("*.j2"))
    for name in parts():
        assert f'live("{name}")' in templates, name


def test_every_page_is_looked_at_in_both_sizes():
    """By the tests that open each page of their list `PAGES`, and those of `IN_THEIR_OWN_TESTS`."""
    looked_at = []
    for test in ("hmi/test_browser.py", "hmi_pages/test_pages.py"):
        body = ast.parse((Path(__file__).parents[1] / test).read_text(encoding="utf-8")).body
        lists = [
            each.value for each in body if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == "PAGES"
        ]
        looked_at += [str(path).replace("SOFT", "7").replace("LAST", "7") for path in ast.literal_eval(lists[0])]
    for module in modules():
        for route in module.router.routes:
            page = "GET" in route.methods and not route.path.startswith("/api/")
            if page and route.path not in NO_PAGES | IN_THEIR_OWN_TESTS:
                assert any(route.path_regex.fullmatch(path) for path in looked_at), route.path


@pytest.mark.parametrize(
    ("language", "value", "digits", "text"),
    [
        ("en", 1234.5, 1, "1\u202f234.5"),
        ("de", 1234.5, 1, "1\u202f234,5"),
        ("es", 0.25, 2, "0,25"),
        ("de", None, 1, NO_VALUE),
        ("de", -3.0, 0, "-3"),
        ("es", 12345.0, 0, "12\u202f345"),
        ("en", float("nan"), 1, NO_VALUE),
    ],
)
def test_numbers_are_written_as_the_language_does(language, value, digits, text):
    assert Locale(language).number(value, digits) == text


def test_a_percentage_and_a_date():
    assert Locale("de").percent(0.375, 1) == "37,5\u00a0%"
    assert Locale("en").percent(0.375) == "38%"
    day = [Locale(language).day(1_700_000_000_000) for language in ("en", "de", "es")]
    assert all(re.fullmatch(r"2023-11-1\d,1\d\.11\.2023,1\d/11/2023", ",".join(day)) for _ in day)


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
        early_stop_mm2=50.0,
        growth_mm2_per_mm=20.0,
        deadline_s=100.0,
        phases_s={},
        picture_step=2,
    )


@pytest.mark.parametrize("areas", [(), (5.0,), (1.0, 20.5, 60.0)])
def test_a_curve_is_drawn_with_every_point_and_limit(areas):
    drawn = ET.fromstring(charts.curve(fruit(areas=areas), Locale("de")))
    circles = [each for each in drawn.iter() if each.tag.endswith("circle")]
    assert len(circles) == len(areas)
    assert drawn.get("role") == "img"
    assert "60,0" in drawn.attrib["aria-label"]
    assert all(0 <= float(each.attrib["cy"]) <= charts.HEIGHT for each in circles)


def test_a_trend_counts_tens():
    outcomes: list[OutcomeName] = ["PASS", "PASS", "FAIL", "FAIL", "NO_RESULT"]
    outcomes.extend(outcomes[0] for _ in range(19))
    many = [fruit(outcome).short for outcome in outcomes]
    drawn = ET.fromstring(charts.trend(many, Locale("en")))
    assert drawn.attrib["aria-label"].endswith("0, 3")
    ET.fromstring(charts.sketch(()))


def test_nothing_is_fetched_from_outside():
    for path in [*(HMI / "templates").iterdir(), *(HMI / "static").iterdir()]:
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/2000/svg", "")
        assert not re.search(r"https?://|//[a-z]+\.", text), path
        assert " style=" not in text, path
