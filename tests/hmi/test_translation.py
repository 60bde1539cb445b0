"""Texts, numbers and dates in the language of the page."""

import ast
import re
from pathlib import Path
from string import Formatter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmi.recipes.form import groups
from hmi.web.folders import HMI
from hmi.web.navigation import entries, modules, parts
from hmi.web.text import texts
from hmi.web.translation import NO_VALUE, Locale, page_translations, preferred, translations
from station.channel.panel_run import OperatorCommandName
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import CameraError, FrameFault
from station.devices.gripper.errors import GripperError, GripperFaultError
from station.inspection.alarm_table import ALARMS
from station.inspection.alarms import AlarmState
from station.inspection.states import STATES
from station.messages import arm, camera, commands, gripper, judge, lots, outbox, recipes
from station.messages.message import verbatim
from station.settings.hmi import LANGUAGES
from station.settings.recipe import load_recipes
from station.vision.paper import PaperMethod
from station.vision.robust import RobustMethod
from station.vocabulary import Flag, PackmlState, Reason

STATION = HMI.parent / "station"
NO_PAGES = {
    "/live",
    "/panel",  # sets a cookie and leads to the pages
    "/fruit/{sequence}/picture.svg",
    "/history/image/{sha256}.png",
    "/history/{sequence}/step/{step}/stage/{place}.jpg",
    "/alarms/{alarm}/part",
    "/change/part",
    "/change/{number}/part",
    "/maintenance/health/part",
    "/maintenance/hand/part",
    "/maintenance/support.zip",
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
    "/jobs/{job}/document/{name}",
}
"""Parts of pages, pictures, streams and files."""
IN_THEIR_OWN_TESTS = {
    "/alarms/{alarm}",
    "/jobs/{job}",
    "/jobs/{job}/show/{name}",
    "/maintenance/configuration",
    "/maintenance/setup",
}
IN_TEMPLATES = re.compile(r"""\bt\(\s*["']([a-z_]+\.[a-zA-Z_.-]+)["'](?=\s*[,)])""")
IN_CODE = re.compile(r"""(?:text\(|Problem\(\d+, |UserStoreError\()["']([a-z_]+\.[a-z_]+)["']""")


def fields(text):
    return sorted(name for _, name, _, _ in Formatter().parse(text) if name)


@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("en", "The area at 3 mm of closing is 131.0 ± 7.2 mm²; the limit for Strawberry of 48.0 mm is 117.4 mm²."),
        ("de",
         "Die Fläche bei 3 mm Schließweg ist 131,0 ± 7,2 mm²; die Grenze für Strawberry von 48,0 mm ist 117,4 mm²."),
        ("es", "El área a 3 mm de cierre es de 131,0 ± 7,2 mm²; el límite para Strawberry de 48,0 mm es 117,4 mm²."),
    ],
)  # fmt: skip
def test_what_the_judge_found_is_said_in_the_language_of_the_page(language, text):
    limit = judge.LIMIT_OF_LENGTH(fruit="Strawberry", length_mm=48.0, limit_mm2=117.4)
    found = judge.AREA_AND_LIMIT(closing_mm=3.0, area_mm2=131.0, uncertainty_mm2=7.2, limit=limit)
    assert Locale(language).sentence(found) == text


def test_words_that_are_not_the_stations_are_marked_as_english_on_other_pages():
    message = verbatim("The <area> of a record of before.")
    assert Locale("en").sentence(message) == "The <area> of a record of before."
    assert Locale("de").sentence(message) == '<span lang="en">The &lt;area&gt; of a record of before.</span>'


@pytest.mark.parametrize(
    ("language", "message", "text"),
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
def test_a_message_is_said_in_the_language_of_the_page(language, message, text):
    assert Locale(language).sentence(message) == text


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_every_alarm_and_state_is_said_in_every_language(language):
    translated = translations(language)
    for row in ALARMS.values():
        assert {row.cause.id, row.consequence.id, row.action.id} <= translated.keys()
    assert {facts.reason.id for facts in STATES.values()} - {"text.sentences"} <= translated.keys()


@pytest.mark.parametrize(
    ("language", "fault", "what", "remedy"),
    [
        ("de", ArmFault(ArmCause.PROTECTIVE_STOP, arm.PROTECTIVE_STOP()), "Arm: der Arm ist im Schutzhalt",
         ". Herausfinden, warum der Arm hielt, seinen Weg frei machen, dann den Schutzhalt bestätigen"),
        ("es", GripperFaultError(0xD), "Pinza: su activación falló (fallo 0x0D, activation_fault)",
         "; busque qué bloquea los dedos, despeje los dedos y active de nuevo la pinza"),
        ("de", GripperError(gripper.LATE_AT(step=gripper.STEP_RESET(), count=7, state=gripper.STATE_IDLE()),
                            verbatim("look")),
         "Greifer: sein Rücksetzen endete nicht rechtzeitig: Die Finger stehen bei Zähler 7, ohne dass eine "  # noqa: ISC004
         "Bewegung verlangt war",
         "; look"),
        ("de", CameraError(camera.NO_FRAME(camera=camera.DIGIT(serial="D1"), limit_s=2.5,
                                           reasons=[camera.NEWEST(age_s=9.25)], remedy=camera.REMEDY_CABLE())),
         "Kamera DIGIT D1: in 2,5 s kein neues Bild; das neueste ist 9,2 s alt",
         ". Kabel und Licht prüfen, dann `station devices check`"),
    ],
)  # fmt: skip
def test_a_fault_is_said_whole_with_what_to_do(language, fault, what, remedy):
    assert Locale(language).sentence(fault.message) == what + remedy


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
    used |= {f"inspection.stage_{stage}" for method in (PaperMethod, RobustMethod) for stage in method.stages}
    assert used <= set(texts()), used - set(texts())
    assert len(used) > 100


def test_every_part_is_somewhere():
    templates = "".join(path.read_text(encoding="utf-8") for path in HMI.rglob("*.j2"))
    for name in parts():
        assert f'live("{name}")' in templates, name


def test_every_page_is_looked_at_in_both_sizes():
    """By the tests that open each page of their list `PAGES`, and those of `IN_THEIR_OWN_TESTS`."""
    paths = []
    for test in ("hmi/test_every_page.py", "hmi_pages/test_every_page.py"):
        body = ast.parse((Path(__file__).parents[1] / test).read_text(encoding="utf-8")).body
        lists = [
            each.value for each in body if isinstance(each, ast.Assign) and ast.unparse(each.targets[0]) == "PAGES"
        ]
        paths += [str(path).replace("SOFT", "7").replace("LAST", "7") for path in ast.literal_eval(lists[0])]
    for module in modules():
        for route in module.router.routes:
            page = "GET" in route.methods and not route.path.startswith("/api/")
            if page and route.path not in NO_PAGES | IN_THEIR_OWN_TESTS:
                assert any(route.path_regex.fullmatch(path) for path in paths), route.path


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


def test_the_stations_own_reasons_are_translated_and_a_persons_words_are_not():
    assert Locale("de").reason(str(recipes.REASON_SHIPPED())) == "mit der Software der Station geliefert"
    assert Locale("de").reason("softer fruit were let through") == "softer fruit were let through"
    assert Locale("en").reason(str(recipes.REASON_ADOPTED())) == "it was there when the recipes' history began"


@pytest.mark.parametrize(
    ("text", "shown"), [("96.5", "96,5"), ("-0.25", "-0,25"), ("98", "98"), ("1.9.3", "1.9.3"), ("robust", "robust")]
)
def test_a_recipes_number_has_the_readers_decimal_sign(text, shown):
    assert Locale("es").figure(text) == shown


def test_one_fruit_and_more_are_counted_rightly():
    assert [Locale("es").text("chart.passed", n=n) for n in (1, 2)] == ["1 apta", "2 aptas"]


def test_a_station_that_waits_out_of_production_is_not_called_ready():
    for language in LANGUAGES:
        assert Locale(language).text("packml.idle") != Locale(language).text("frame.ready")
