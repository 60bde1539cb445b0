"""The pages that are made to be printed come out as specified, by a real browser."""

import re
import subprocess
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

from hmi.recipes.form import field_texts
from hmi.web.folders import HMI
from hmi.web.text import texts
from hmi.web.translation import Locale, page_renderer
from station.settings.hmi import LANGUAGES
from tests.chromium import ARGUMENTS

STYLE = Path(__file__).with_name("print.css")
PAGE = re.compile(rb"/Type\s*/Page\b")
ITALIC = re.compile(r"(?<!\*)\*([^*]+)\*(?!\*)")
TAB_OF_THE_BALL = ("layout", "sensor", "mode")
"""Its templates."""
OPERATORS_GUIDES = {
    language: "operator.md" if language == "en" else f"operator.{language}.md" for language in LANGUAGES
}


@pytest.fixture
def printed(chromium, pages, tmp_path):
    """Prints a document on A4 and gives the number of its pages."""

    def make(name):
        page = pages[name]
        body = MarkdownIt("commonmark", {"html": True}).enable("table").render(page.path.read_text("utf-8"))
        html, pdf = tmp_path / "page.html", tmp_path / "page.pdf"
        base = f'<base href="{page.path.parent.as_uri()}/">'
        html.write_text(f"<!doctype html><meta charset=utf-8>{base}<style>{STYLE.read_text()}</style>{body}", "utf-8")
        command = [chromium, *ARGUMENTS, "--no-pdf-header-footer"]
        command += [f"--user-data-dir={tmp_path / 'browser'}", f"--print-to-pdf={pdf}", html.as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=300)
        return len(PAGE.findall(pdf.read_bytes()))

    return make


@pytest.mark.timeout(400)
@pytest.mark.parametrize(
    ("name", "number"), [*((guide, 2) for guide in OPERATORS_GUIDES.values()), ("acceptance-test.md", 3)]
)
def test_a_document_to_print_has_its_pages(printed, name, number):
    assert 1 < printed(f"docs/{name}") <= number


def test_the_operators_guide_shows_screens(pages):
    shown = {target for _, target in pages["docs/operator.md"].links if target.endswith(".png")}
    assert len(shown) >= 3


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_the_operators_guide_calls_a_button_is_written_on_the_panel(pages, language):
    words = {page_renderer(language).form(each, count) for each in texts().values() for count in (1, 2)}
    words |= {Locale(language).own(key, title) for key, (title, _) in field_texts().items()}
    beginnings = {text.partition("{")[0] for text in words if "{" in text}
    guide = pages[f"docs/{OPERATORS_GUIDES[language]}"].path.read_text("utf-8")
    named = set(ITALIC.findall(guide))
    assert len(named) > 25
    unknown = {each for each in named if each.rstrip("…") not in beginnings and not {each, each + "."} & words}
    assert unknown == set()


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_ball_needs_no_button_of_another_tab(pages, language):
    guide = pages[f"docs/{OPERATORS_GUIDES[language]}"].path.read_text("utf-8")
    (ball,) = [part for part in guide.split("\n## ") if "*Sensor*" in part]
    named, written = set(ITALIC.findall(ball)), page_renderer(language)
    own = {key for key, each in texts().items() if key.startswith("maintenance.") and written.form(each, 1) in named}
    own = {key for key in own if not key.startswith("maintenance.run_is_")}
    assert len(own) >= 4
    tab = "".join((HMI / "maintenance" / f"maintenance_{each}.html.j2").read_text("utf-8") for each in TAB_OF_THE_BALL)
    assert {key for key in own if f't("{key}")' not in tab} == set()
