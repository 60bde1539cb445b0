"""A site's recipes in a folder of the test's own, and the command line that manages them."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from station.settings.recipe import recipe_files
from tests.command_line import call


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path / "home"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A site's recipes: a release's, which no later tuning of the shipped ones changes."""
    folder = tmp_path / "recipes"
    folder.mkdir()
    for file in recipe_files(Path(__file__).parent / "golden" / "form_1"):
        shutil.copy(file, folder)
    return folder


@pytest.fixture
def station(site: Path, home: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """Run the command line; return its exit code and its output."""
    monkeypatch.setenv("STATION_HOME", str(home))
    monkeypatch.setenv("STATION_RECIPES_FOLDER", str(site))
    return call


@pytest.fixture
def does(station: Callable[..., tuple[int, str]]) -> Callable[..., str]:
    """Let a person do something with a recipe, and expect that it is done."""

    def do(who: str, *arguments: object, why: str = "a test") -> str:
        code, output = station("recipes", *arguments, "--who", who, "--reason", why)
        assert code == 0, output
        return output

    return do


@pytest.fixture
def adopted(station: Callable[..., tuple[int, str]]) -> None:
    assert station("recipes", "adopt")[0] == 0
