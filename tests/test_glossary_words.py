"""The check of the glossary's words: what it finds, what it lets pass, and that the project passes."""

import pytest

from tests import glossary_words
from tests.glossary_words import GLOSSARY, MEANT, OTHER_SENSES, ROOT, avoided, finder, findings, of_document, of_module

FIND = finder({"crew", "stands", "alarm desk", "tell"})


@pytest.fixture(scope="module")
def words():
    return avoided((ROOT / GLOSSARY).read_text("utf-8"))


def test_the_project_has_none():
    assert [str(each) for each in findings()] == []


def test_the_words_are_the_glossarys_last_column(words):
    assert {"crew", "alarm desk", "drift", "evening", "tell"} <= words
    assert not words & {"±", "in older documents", "---", ""}


def test_each_exception_is_one_of_a_word_of_the_glossary_that_is_still_there(words):
    assert OTHER_SENSES.keys() | MEANT.keys() <= words
    gone = []
    for word, files in MEANT.items():
        find = finder({word})
        for file in files:
            search = of_module if file.endswith(".py") else of_document
            if not list(search(file, (ROOT / file).read_text("utf-8"), find)):
                gone.append((word, file))
    assert gone == []


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ("class CrewState: pass", "crew"),
        ("async def wake_crews(): pass", "crew"),
        ("class AlarmDesk: pass", "alarm desk"),
        ('def f():\n    """Tells an alarm."""', "tell"),
        ('"""Alarm manager: what stands."""', "stands"),
        ('"""Which alarms are active."""', "Which"),
        ('class A:\n    """What it holds."""', "What"),
        ('def is_open():\n    """Whether it is open."""', "Whether"),
    ],
)
def test_a_word_to_avoid_is_found_in_python(source, word):
    assert [each.word for each in of_module("station/new.py", source, FIND)] == [word]


def test_it_is_found_in_a_modules_name():
    assert [each.word for each in of_module("station/service/crew.py", "", FIND)] == ["crew"]


def test_bodies_of_docstrings_and_parts_of_words_pass():
    source = 'class Screwed:\n    """Device manager.\n\n    The crew.\n    """\n    crew = "stands"'
    assert list(of_module("station/new.py", source, FIND)) == []


def test_documents_are_searched_without_their_code():
    text = "The `crew` of\n```\ncrew\n```\n[the manager](crew.md) is told.\nAn alarm stands."
    assert [(each.line, each.word) for each in of_document("docs/new.md", text, FIND)] == [(6, "stands")]


def test_a_sense_is_meant_outside_of_the_rooms_where_it_cannot_be():
    def meant(file, word):
        return glossary_words.meant(glossary_words.Finding(file, 1, "", word))

    assert meant("station/vision/press.py", "frame")
    assert not meant("plc_interface/server/server.py", "frame")
    assert meant("plc_interface/server/mbap.py", "frame")
    assert meant("docs/robust.md", "truth")
    assert not meant("station/runtime/cycle/service.py", "crew")
