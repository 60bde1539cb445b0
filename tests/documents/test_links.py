"""Every link and picture leads somewhere, and every document can be reached from the index."""

from urllib.parse import unquote, urlsplit

import pytest

from station.inspection.alarm_table import ALARMS


def broken(page, pages, root):
    for line, target in page.links:
        parts = urlsplit(target)
        if parts.scheme or parts.netloc:
            continue
        place = (page.path.parent / unquote(parts.path)).resolve() if parts.path else page.path
        where = f"{page.name}:{line}: {target}"
        if not place.is_relative_to(root) or not place.exists():
            yield f"{where}: there is no such file"
        elif parts.fragment:
            other = pages.get(place.relative_to(root).as_posix())
            if other is None:
                yield f"{where}: an anchor in what is no document"
            elif parts.fragment not in other.anchors:
                yield f"{where}: there is no such heading"


def test_every_link_picture_and_anchor_is_there(pages, root):
    found = [each for page in pages.values() for each in broken(page, pages, root)]
    assert found == []
    assert sum(len(page.links) for page in pages.values()) > 200


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[x](no.md)", "no such file"),
        ("[x](README.md#no-such)", "no such heading"),
        ("![x](docs/images/no.png)", "no such file"),
        ('<img src="docs/images/no.png">', "no such file"),
        ("[x](#here)", "no such heading"),
        ("[x](../../../etc/passwd)", "no such file"),
    ],
)
def test_a_link_that_leads_nowhere_is_found(text, message, pages, page, root, monkeypatch):
    made = page(root / "CHANGELOG.md")
    assert pages["README.md"].anchors  # read as it is, and cached
    monkeypatch.setattr(type(made.path), "read_text", lambda *_, **__: f"# Title\n\n{text}\n")
    assert made.anchors == {"title"}
    assert [message in each for each in broken(made, {**pages, made.name: made}, root)] == [True]


def test_a_heading_is_reached_as_on_github(pages):
    assert {"emergency-stop", "life-of-an-alarm"} <= pages["docs/alarms.md"].anchors
    assert "where-values-come-from" in pages["docs/configuration.md"].anchors


def test_every_document_is_reached_from_the_index(pages, root):
    reached, waiting = set(), ["docs/index.md"]
    while waiting:
        page = pages[waiting.pop()]
        if page.name in reached:
            continue
        reached.add(page.name)
        for _, target in page.links:
            place = (page.path.parent / urlsplit(target).path).resolve()
            if place.suffix == ".md" and place.is_relative_to(root / "docs"):
                waiting.append(place.relative_to(root).as_posix())
    documents = {name for name in pages if name.startswith("docs/")}
    assert documents - reached == set()


def test_the_readme_leads_to_the_index(pages):
    assert "docs/index.md" in {target for _, target in pages["README.md"].links}


def test_every_alarm_has_a_heading_and_a_line_in_the_maintenance_guide(pages):
    anchors = {alarm.replace("_", "-") for alarm in ALARMS}
    assert anchors <= pages["docs/alarms.md"].anchors
    linked = {target.partition("#")[2] for _, target in pages["docs/maintenance.md"].links if "alarms.md#" in target}
    assert anchors - linked == set()
