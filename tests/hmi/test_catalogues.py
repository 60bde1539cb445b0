"""The message catalogues of all languages: complete, with the source's braces, and read by ids."""

import re
from types import ModuleType

import pytest
from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po

from hmi.web import catalogues, translation
from hmi.web.catalogues import findings, sources, translated, update
from hmi.web.folders import FOLDERS, HMI
from hmi.web.navigation import entries
from hmi.web.text import define, define_plural, texts
from hmi.web.translation import Locale
from station import messages
from station.messages import channel
from station.messages.message import Definition, definitions
from station.settings.hmi import LANGUAGES

MESSAGES = "hmi/locale/"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of catalogues for one page with three texts."""
    monkeypatch.setattr(catalogues, "ROOT", tmp_path)
    english = {"run.state": ("State",), "run.one": ("{n} pear", "{n} pears"), "run.at": ("at {width_mm} mm",)}
    monkeypatch.setattr(catalogues, "sources", lambda: {"hmi/run/{}.po": english})
    return tmp_path, english


def translate(path, **texts_by_name):
    with path.open("rb") as file:
        catalog = read_po(file, locale="de")
    for entry in catalog:
        if entry.context and (string := texts_by_name.get(entry.context.partition(".")[2])):
            entry.string = string
    path.write_bytes(catalogues._written(catalog, "de"))


def test_every_text_is_translated_with_its_braces():
    found = [str(each) for language in translated() for each in findings(language)]
    assert not found, "\n".join(found)


def test_what_is_extracted_from_the_source_is_what_is_defined():
    extracted = {file: set(found) for file, found in sources().items()}
    pages = {key for file, keys in extracted.items() if not file.startswith(MESSAGES) for key in keys}
    assert {key for key in pages if not key.startswith(("recipe_field.", "recipe_what."))} == set(
        filter(lambda key: key != "change.by", texts())
    )
    used = {key for file, keys in extracted.items() if file.startswith(MESSAGES) for key in keys}
    defined = {each.id: each for each in definitions() if not each.id.startswith("test.")}
    assert used <= set(defined)
    assert not [key for key in set(defined) - used if catalogues._is_text(defined[key].english)]


def test_every_module_is_imported_by_its_package():
    assert {path.stem for path in catalogues._ROOMS.glob("[a-z]*.py")} == {
        name for name, each in vars(messages).items() if isinstance(each, ModuleType)
    }


def test_what_an_id_begins_with_names_its_file():
    files_of: dict[str, set[str]] = {}
    for file, found in sources().items():
        for key in found if not file.startswith(MESSAGES) else ():
            files_of.setdefault(key.partition(".")[0], set()).add(file)
    assert [start for start, files in files_of.items() if len(files) > 1] == []
    assert files_of["run"] == {"hmi/run/{}.po"}


def test_every_folder_of_a_page_is_in_the_list():
    assert {path.parent.name for path in HMI.glob("*/texts.py")} == set(FOLDERS)


def test_a_text_is_defined_once_and_a_plural_contains_its_number():
    assert "run.state" in texts()
    with pytest.raises(ValueError, match="twice"):
        define("run.state", "again")
    with pytest.raises(ValueError, match="lacks"):
        define_plural("run.new", "{n} pear", "pears", "n")
    assert "run.new" not in texts()


def test_a_new_language_gets_files_to_translate(folder):
    place, english = folder
    assert update("de") == [place / "hmi/run/de.po"]
    assert update("de") == []
    assert {each.id for each in findings("de")} == set(english)
    translate(place / "hmi/run/de.po", state="Zustand", one=("{n} Birne", "{n} Birnen"), at="bei {width_mm} mm")
    assert not list(findings("de"))


def test_changed_texts_are_found(folder):
    place, english = folder
    update("de")
    file = place / "hmi/run/de.po"
    translate(file, state="Zustand", one=("{n} Birne", "{m} Birnen"), at="bei {width} mm")
    assert {each.id for each in findings("de")} == {"run.one", "run.at"}
    english["run.state"] = ("Condition",)
    assert [each.id for each in catalogues.reworded("de")] == ["run.state"]
    del english["run.at"]
    update("de")
    assert {each.id: each.what.partition(" ")[0] for each in findings("de")} == {"run.state": "its", "run.one": "has"}


def test_a_file_without_texts_is_removed(folder):
    place, _ = folder
    update("de")
    left_over = place / "hmi/gone/de.po"
    left_over.parent.mkdir()
    left_over.write_bytes(catalogues._written(Catalog(locale="de"), "de"))
    assert [each.file for each in findings("de") if each.id == "the file"] == [left_over]
    assert update("de") == [left_over]
    assert not left_over.exists()


def test_a_reworded_text_keeps_its_translation_until_it_is_reviewed(folder, monkeypatch):
    place, english = folder
    update("de")
    file = place / "hmi/run/de.po"
    translate(file, state="Zustand", at="bei {width_mm} mm")
    english["run.state"], english["run.at"] = ("Condition",), ("at {width_m} m",)
    update("de")
    assert translation._read([file], "de") == {"run.state": ("Zustand",)}


@pytest.mark.parametrize(("number", "text"), [(1, "1 Tag"), (2, "2 Tage"), (0, "0 Tage")])
def test_a_number_chooses_the_form(number, text):
    assert Locale("de").text("common.days", n=number) == text


def test_a_message_is_written_in_every_language():
    message = channel.NO_ANSWER(peer="arm", request="Pose", limit_s=2.5)
    written = {language: Locale(language).sentence(message) for language in LANGUAGES}
    assert written["en"] == str(message)
    assert len(set(written.values())) == len(LANGUAGES)
    assert all("2,5 s" in written[language] for language in ("de", "es"))


def test_a_text_without_a_translation_is_english():
    form = translation._chooser("de", {})
    assert form(Definition("test.none", "{n} pear", {}, "{n} pears", "n"), 2) == "{n} pears"


def test_a_language_has_a_name_of_its_own():
    assert [Locale.name_of(language) for language in LANGUAGES][:3] == ["English", "Deutsch", "Español"]


@pytest.mark.parametrize(("language", "word"), [("en", "page"), ("de", "Seite"), ("es", "página")])
def test_a_page_that_a_text_names_is_one_of_the_navigation(language, word):
    pages = tuple(Locale(language).text(f"nav.{entry.name}") for entry in entries())
    named = re.compile(rf"\b{word} (?=[A-ZÄÖÜÁÉÍÓÚ])")
    found = {
        key: text[place.end() :]
        for file, english in sources().items()
        for key, forms in (
            english if language == "en" else translation._read([catalogues.ROOT / file.format(language)], language)
        ).items()
        for text in forms
        for place in named.finditer(text)
    }
    assert len(found) > 5
    assert {key: rest for key, rest in found.items() if not rest.startswith(pages)} == {}
