"""The pages that are made to be printed come out as said, by a real browser."""

import re
import subprocess
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

STYLE = Path(__file__).with_name("print.css")
PAGE = re.compile(rb"/Type\s*/Page\b")


@pytest.fixture
def printed(chromium, pages, tmp_path):
    """Prints a document on A4 and gives the number of its pages."""

    def make(name):
        page = pages[name]
        body = MarkdownIt("commonmark", {"html": True}).enable("table").render(page.path.read_text("utf-8"))
        html, pdf = tmp_path / "page.html", tmp_path / "page.pdf"
        base = f'<base href="{page.path.parent.as_uri()}/">'
        html.write_text(f"<!doctype html><meta charset=utf-8>{base}<style>{STYLE.read_text()}</style>{body}", "utf-8")
        command = [chromium, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer"]
        command += [f"--user-data-dir={tmp_path / 'browser'}", f"--print-to-pdf={pdf}", html.as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        return len(PAGE.findall(pdf.read_bytes()))

    return make


@pytest.mark.parametrize(("name", "number"), [("docs/operator.md", 2), ("docs/acceptance-test.md", 3)])
def test_a_document_to_print_has_its_pages(printed, name, number):
    assert 1 < printed(name) <= number


def test_the_operators_guide_shows_screens(pages):
    shown = {target for _, target in pages["docs/operator.md"].links if target.endswith(".png")}
    assert len(shown) >= 3
