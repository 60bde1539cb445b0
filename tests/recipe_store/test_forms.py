"""Recipe files of every released form are read for ever, and written in the present form with their comments."""

import json
from pathlib import Path

import pytest

from station.settings import recipe_versions
from station.settings.problems import SettingsError
from station.settings.recipe import load_recipe
from station.settings.recipe_text import with_values
from station.settings.recipe_versions import SCHEMA_VERSION, content_sha256, parse_recipe

GOLDEN = Path(__file__).parent / "golden"
FORMS = sorted(GOLDEN.iterdir())


def to_first_form(values):
    """A migration as a release would have it: one field got another name."""
    damage, old, new = values["damage"], "growth", "growth_mm2_per_mm"
    if old not in damage:
        return
    comments = getattr(getattr(damage, "ca", None), "items", {})  # ruamel's, by key
    comment = comments.pop(old, None)
    entries = [(new if name == old else name, value) for name, value in damage.items()]
    for name in list(damage):
        del damage[name]
    damage.update(entries)
    if comment is not None:
        comments[new] = comment


@pytest.fixture
def earlier_form(monkeypatch, site):
    """A program that knows a form before the first, and a strawberry's file in it."""
    monkeypatch.setattr(recipe_versions, "MIGRATIONS", {0: to_first_form})
    file = site / "strawberry.yaml"
    text = file.read_text().replace("schema_version: 1\n", "schema_version: 0\n")
    file.write_text(text.replace("  growth_mm2_per_mm: 41  #", "  growth: 41  #"))
    return file


def test_there_is_a_golden_file_of_every_form():
    assert [form.name for form in FORMS] == [f"form_{number}" for number in range(1, SCHEMA_VERSION + 1)]


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_files_of_a_released_form_still_say_what_they_said(form):
    hashes = json.loads((form / "hashes.json").read_text())
    assert {file.stem: content_sha256(load_recipe(file)) for file in form.glob("*.yaml")} == hashes


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_writing_back_changes_nothing_that_was_not_asked_for(form):
    for file in form.glob("*.yaml"):
        assert with_values(file.read_text(), {}, str(file))[0] == file.read_text()


def test_an_earlier_form_is_read_and_written_back_with_its_comments_and_a_backup(earlier_form, station, does, home):
    before = earlier_form.read_text()
    assert load_recipe(earlier_form).damage.growth_mm2_per_mm == 41
    assert station("recipes", "adopt")[0] == 0
    assert "strawberry: revision 1 in force" in station("recipes", "list")[1]
    assert "strawberry.yaml: schema version 0 upgraded\n1 files were upgraded" in does("Ida", "upgrade")
    after = earlier_form.read_text()
    assert "schema_version: 1\n" in after
    assert after.count("#") == before.count("#")
    assert (
        content_sha256(load_recipe(earlier_form))
        == json.loads((GOLDEN / "form_1" / "hashes.json").read_text())["strawberry"]
    )
    (backup,) = (home / "recipe_backups").iterdir()
    assert backup.read_text() == before
    assert "file: approved" in station("recipes", "list")[1], "the same values are no change of the recipe"
    assert "0 files were upgraded" in does("Ida", "upgrade")


def test_a_bad_file_of_an_earlier_form_is_told_with_its_line(earlier_form):
    earlier_form.write_text(earlier_form.read_text().replace("growth: 41", "growth: x"))
    with pytest.raises(SettingsError, match=r"growth_mm2_per_mm: expected a number"):
        load_recipe(earlier_form)


def test_a_newer_form_is_left_alone(site):
    newer = SCHEMA_VERSION + 1
    text = (site / "strawberry.yaml").read_text().replace("schema_version: 1\n", f"schema_version: {newer}\n")
    message = rf"x:\d+: schema_version: expected at most {SCHEMA_VERSION}, got {newer} of a newer"
    with pytest.raises(SettingsError, match=message):
        parse_recipe(text, "x")
