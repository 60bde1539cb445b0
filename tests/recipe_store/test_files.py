"""A folder of recipes, read again and again while a station runs."""

from station.recipe_store.files import read_folder
from station.settings import recipe_versions


def test_a_file_is_parsed_once_for_each_content(site, monkeypatch):
    parsed, parse_document = [], recipe_versions.parse_document

    def parse(content, source):
        parsed.append(source)
        return parse_document(content, source)

    monkeypatch.setattr(recipe_versions, "parse_document", parse)
    first = read_folder(site).found
    assert sorted(parsed) == sorted(str(file.path) for file in first)
    assert read_folder(site).found == first
    assert len(parsed) == len(first)

    changed = first[0].path
    changed.write_text(first[0].text.replace("title:", "title:  "), encoding="utf-8")
    read_folder(site)
    assert parsed[len(first) :] == [str(changed)]
