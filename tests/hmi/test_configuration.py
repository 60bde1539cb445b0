"""The page Configuration: `station.yaml` edited as text, checked, stored, and taken back."""

import asyncio
import html
import re
from typing import Any

import pytest

from hmi.configuration.file import digest
from hmi.web.roles import Role
from station.channel.panel_run import PersonNoted
from tests.hmi.test_security import log_in

PATH = "/maintenance/configuration"
TEXT = "# the site's own\nmodbus:\n  unit: 7  # as the PLC has it\n"
CHANGED = TEXT.replace("7", "9")


@pytest.fixture
def file(pages, tmp_path):
    """The site's file; an administrator is logged in."""
    log_in(pages)
    file = tmp_path / "station.yaml"
    file.write_text(TEXT)
    file.chmod(0o640)
    return file


@pytest.fixture
def noted(pages, monkeypatch) -> list[PersonNoted]:
    """Collect the notes that are sent to the audit trail."""
    sent: list[PersonNoted] = []
    monkeypatch.setattr(pages.context.gateway, "note", lambda note: asyncio.sleep(0, sent.append(note)))
    return sent


def save(pages, text: str, base: str = TEXT) -> tuple[int, str]:
    status, _, body = pages.post(PATH, csrf=pages.token(), text=text.replace("\n", "\r\n"), base=digest(base))
    return status, html.unescape(body.decode())


def shown(pages) -> str:
    status, _, body = pages("GET", PATH)
    assert status == 200
    return html.unescape(re.findall(r"<textarea[^>]*>\n(.*?)</textarea>", body.decode(), re.DOTALL)[0])


def test_the_file_is_edited_with_its_comments_and_taken_back(pages, file, noted):
    assert shown(pages) == TEXT
    assert b"Put the former file back" not in pages("GET", PATH)[2]
    assert save(pages, CHANGED)[0] == 303
    assert (file.read_text(), file.stat().st_mode & 0o777) == (CHANGED, 0o640)
    assert file.with_name("station.yaml.former").read_text() == TEXT
    assert b"Put the former file back" in pages("GET", PATH)[2]
    assert pages.post(PATH + "/former", csrf=pages.token(), base=digest(CHANGED))[0] == 303
    assert file.read_text() == TEXT
    assert file.with_name("station.yaml.former").read_text() == CHANGED, "so taking back is taken back too"
    assert [(note.person.who, note.old, note.new) for note in noted] == [
        ("admin", {"modbus.unit": 7}, {"modbus.unit": 9}),
        ("admin", {"modbus.unit": 9}, {"modbus.unit": 7}),
    ]


@pytest.mark.parametrize(
    ("language", "words"),
    [
        ("en", ("Line 3", "modbus.unit", "Not saved", "Line 4", "did you mean")),
        ("de", ("Zeile 3", "modbus.unit", "Nicht gespeichert", "Zeile 4", "unbekannter Name")),
        ("es", ("Línea 3", "modbus.unit", "No se guardó", "Línea 4", "nombre desconocido")),
    ],
)
def test_every_mistake_is_shown_at_its_line_and_nothing_is_saved(pages, file, noted, language, words):
    pages.cookies["station_language_8080"] = language
    wrong = TEXT.replace("7", "seven") + "gripperr: {}\n"
    status, body = save(pages, wrong)
    assert status == 400
    assert [word for word in words if word not in body] == []
    assert "unit: seven" in body, "the typed text stays"
    assert (file.read_text(), noted) == (TEXT, [])
    assert not file.with_name("station.yaml.former").exists()


def test_a_file_that_is_too_large_for_the_loader_is_refused(pages, file):
    assert "64 KiB" in save(pages, TEXT + "#" + "é" * 33_000 + "\n")[1]
    assert file.read_text() == TEXT


def test_a_file_changed_meanwhile_is_not_overwritten(pages, file, noted):
    file.write_text("# by hand\n" + TEXT)
    status, body = save(pages, CHANGED)
    assert (status, "changed meanwhile" in body, noted) == (400, True, [])
    assert file.read_text() == "# by hand\n" + TEXT


def test_a_file_broken_by_hand_shows_its_mistakes(pages, file):
    file.write_text("modbus: [\n")
    assert b"The file has mistakes" in pages("GET", PATH)[2]


def test_a_file_that_may_not_be_written_is_shown_with_the_remedy(pages, file, noted, monkeypatch):
    monkeypatch.setattr("hmi.configuration.routes.os.access", lambda *_: False)
    body = html.unescape(pages("GET", PATH)[2].decode())
    assert f"sudoedit {file}" in body
    assert "Check and save" not in body

    def refused(*_: Any, **__: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("hmi.configuration.file.write_atomically", refused)
    status, body = save(pages, CHANGED)
    assert (status, "cannot be written: Permission denied" in body, noted) == (400, True, [])
    assert file.read_text() == TEXT


@pytest.mark.parametrize("role", [Role.OPERATOR, Role.QUALITY, Role.MAINTENANCE])
def test_only_an_administrator_sees_and_saves_it(pages, file, role):
    log_in(pages, "Ana", role)
    assert pages("GET", PATH)[0] == 403
    assert save(pages, CHANGED)[0] == 403
    assert pages.post(PATH + "/former", csrf=pages.token(), base=digest(TEXT))[0] == 403
    assert file.read_text() == TEXT
