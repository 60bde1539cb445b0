"""Files of the home folder: the last good form of each, whole after a crash in the middle of writing."""

import asyncio
import json
import socket

import pytest

from station.records import open as opening
from station.runtime.recipes.active import ActiveRecipe, ActiveRecipes
from station.settings.last_good import load_or_last_good
from station.settings.problems import SettingsError
from station.state_files import StateFiles


def test_a_broken_configuration_is_replaced_by_its_last_good_form(settings_file, tmp_path, monkeypatch):
    monkeypatch.delenv("STATION_HOME", raising=False)
    file = settings_file()
    good, broken = load_or_last_good(file)
    assert broken == ""
    file.write_text("service: {bench: 12}")
    monkeypatch.setenv("STATION_HOME", str(good.home))
    again, broken = load_or_last_good(file)
    assert again == good
    assert "service.bench" in broken
    assert str(file) in broken
    other = tmp_path / "other.yaml"
    other.write_text("service: {bench: 12}")
    with pytest.raises(SettingsError):
        load_or_last_good(other)


def test_a_broken_recipe_is_replaced_by_its_last_good_form_and_a_removed_one_is_gone(settings_file, tmp_path):
    settings_file()
    folder, state_files = tmp_path / "recipes", StateFiles(tmp_path / "home")
    book = ActiveRecipes(folder, state_files)
    book.read()
    assert book.numbers == (1, 2, 3)
    assert book.problems == ()
    blueberry = book.find(2)
    assert blueberry is not None
    assert book.store_active(blueberry, "LOT 1")
    (folder / "blueberry.yaml").write_text("name: [")
    (folder / "raspberry.yaml").unlink()

    later = ActiveRecipes(folder, state_files)
    later.read()
    assert later.numbers == (1, 2)
    assert later.restored() == (blueberry, "LOT 1")
    assert any("blueberry.yaml" in str(problem) for problem in later.problems)


def test_a_checksum_is_that_of_the_recipe_and_of_nothing_else(settings_file, tmp_path):
    settings_file()
    book = ActiveRecipes(tmp_path / "recipes", StateFiles(tmp_path / "home"))
    book.read()
    active = book.find(1)
    assert active is not None
    assert json.loads(active.snapshot.text) == active.recipe.model_dump(mode="json")
    other = active.recipe.model_copy(update={"title": "Other"})
    assert ActiveRecipe.of(other).snapshot.checksum != active.snapshot.checksum


def test_a_file_is_there_whole_or_not_at_all(tmp_path):
    state_files = StateFiles(tmp_path)
    assert state_files.read("a/b.json") is None
    assert state_files.write("a/b.json", b"first")
    before = (tmp_path / "a" / "b.json").stat().st_ino
    assert state_files.write("a/b.json", b"first")
    assert (tmp_path / "a" / "b.json").stat().st_ino == before, "nothing is written where nothing changes"
    assert state_files.write("a/b.json", b"second")
    assert state_files.read("a/b.json") == b"second"
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b.json"]
    (tmp_path / "file").write_bytes(b"")
    assert not state_files.write("file/inside", b"x")


def test_a_start_whose_records_take_long_to_open_extends_its_limit(bench, tmp_path, monkeypatch):
    """The migration goes on until the supervisor has heard of it."""
    migrate, heard = opening.migrate, []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as supervisor:
        supervisor.bind(str(tmp_path / "notify"))
        supervisor.settimeout(60.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))

        def long_migration(engine, folder):
            heard.append(supervisor.recv(4096).decode())
            migrate(engine, folder)

        monkeypatch.setattr(opening, "migrate", long_migration)

        async def start():
            async with bench():
                supervisor.settimeout(0.0)

        asyncio.run(start())
    assert heard == ["EXTEND_TIMEOUT_USEC=60000000"]
