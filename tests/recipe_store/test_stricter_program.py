"""An upgrade to a program that refuses what was submitted or approved before: a good file gets over it."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from station.messages import recipes
from station.recipe_store import revision, store
from station.records.audit_report import read_audit
from station.records.database import reading
from station.runtime.recipes.active import ActiveRecipes
from station.settings import recipe_versions
from station.settings.damage import DamageThresholds
from station.settings.recipe import load_recipe
from station.settings.recipe_versions import content_sha256
from station.state_files import StateFiles

Earlier = Callable[[], AbstractContextManager[None]]
NOT_ACCEPTED = "this program does not accept that revision any more: raspberry@{}:66: damage.area[0].least_area_mm2: "


@pytest.fixture
def earlier(monkeypatch: pytest.MonkeyPatch) -> Earlier:
    """A program from before limits without room for the guard band were refused."""

    def forget() -> None:
        revision._parsed.cache_clear()
        recipe_versions.recipe_of.cache_clear()

    @contextmanager
    def earlier_program() -> Iterator[None]:
        with monkeypatch.context() as patch:
            patch.setattr(DamageThresholds, "_kept_by_no_area", lambda _: ())
            forget()
            yield
        forget()

    return earlier_program


def least_area(site: Path, mm2: int) -> None:
    """Edit the file by hand."""
    file = site / "raspberry.yaml"
    head, _, tail = file.read_text().partition("least_area_mm2: ")
    file.write_text(f"{head}least_area_mm2: {mm2}{tail[2:]}")


def book_of(site, home):
    book = ActiveRecipes(site, StateFiles(home))
    book.read()
    return book


def in_force(book):
    active = book.find(3)
    return None if active is None else (active.snapshot.revision, active.recipe.damage.area[0].least_area_mm2)


def test_a_draft_that_is_refused_now_neither_ends_the_station_nor_the_work_on_its_recipe(
    earlier, station, does, site, home
):
    with earlier():
        assert station("recipes", "adopt")[0] == 0
        does("Ida", "edit", "raspberry", "--set", "damage.area[0].least_area_mm2=66")
        does("Ida", "submit", "raspberry")
        seen = content_sha256(load_recipe(site / "raspberry.yaml"))
    book = book_of(site, home)
    assert in_force(book) == ("1", 35)
    assert "raspberry.yaml:66: damage.area[0].least_area_mm2: expected room" in str(book.problems[0])

    least_area(site, 40)
    for now in (book, book_of(site, home)):  # the station that runs, and its next start
        now.refresh()
        assert in_force(now) == ("1", 35)
        (problem,) = now.problems
        assert problem.parameters["todo"] == recipes.DO_SUBMIT(recipe="raspberry")
        assert now.take_noticed()

    edit = ("edit", "raspberry", "--set", "damage.area[0].least_area_mm2=41", "--base", seen)
    for who, arguments in (("Cy", ("submit", "raspberry")), ("Bo", ("approve", "raspberry")), ("Ida", edit)):
        code, output = station("recipes", *arguments, "--who", who, "--reason", "x")
        assert code == 1
        assert NOT_ACCEPTED.format(2) in output
    code, output = station("recipes", "history", "raspberry")
    assert code == 0
    assert "    raspberry@2:66: damage.area[0].least_area_mm2: expected room" in output
    does("Ida", "submit", "raspberry")
    does("Bo", "approve", "raspberry")
    assert in_force(book_of(site, home)) == ("3", 40)


def test_in_place_of_an_approved_revision_that_is_refused_now_a_good_file_is_approved(
    earlier, station, does, site, home
):
    least_area(site, 66)
    with earlier():
        assert station("recipes", "adopt")[0] == 0
        assert in_force(book_of(site, home)) == ("1", 66)
    assert in_force(book_of(site, home)) is None
    least_area(site, 40)
    does("Ida", "submit", "raspberry")
    does("Bo", "approve", "raspberry")
    assert in_force(book_of(site, home)) == ("2", 40)
    with reading(home / "records") as connection:
        (row,) = read_audit(connection, 2, "recipe.approved", "")
    assert NOT_ACCEPTED.format(1) in str(row.new)


def test_a_shipped_recipe_takes_the_place_of_the_former_one_that_is_refused_now(
    earlier, station, site, home, monkeypatch
):
    def ship(least_area_mm2):
        least_area(site, least_area_mm2)
        shipped = {"raspberry": content_sha256(load_recipe(site / "raspberry.yaml"))}
        monkeypatch.setattr(store, "approved_by_distribution", lambda: shipped)

    with earlier():
        ship(66)
        assert in_force(book_of(site, home)) == ("1", 66)
    ship(40)
    assert in_force(book_of(site, home)) == ("2", 40)
