"""A recipe's way from a person's edit to the line: what another person has not approved is never in force."""

import errno
import json
import os
import shutil
import sqlite3
import subprocess
from pathlib import Path

import pytest
from sqlalchemy.engine.default import DefaultDialect

from station.messages import recipes
from station.recipe_store import files
from station.recipe_store.revision import RecipeStoreError
from station.records.model import RecipeSnapshot
from station.runtime.recipes.active import ActiveRecipes
from station.settings.recipe import APPROVED_NAME, approved_list, load_recipe, shipped_folder
from station.settings.recipe_versions import content_sha256
from station.state_files import StateFiles

LIMIT = "damage.area[0].area_mm2"


def book_of(site, home):
    book = ActiveRecipes(site, StateFiles(home))
    book.read()
    return book


def limit(book):
    active = book.find(1)
    return None if active is None else (active.recipe.damage.area[0].area_mm2, active.snapshot.revision)


def test_what_is_shipped_is_in_force_out_of_the_box(home):
    book = book_of(None, home)
    assert book.numbers == (1, 2, 3, 100)
    assert book.problems == ()
    assert (shipped_folder() / APPROVED_NAME).read_text() == approved_list()


def test_a_draft_is_in_force_once_another_person_approves_it(adopted, station, does, site, home):
    comments = [line for line in (site / "strawberry.yaml").read_text().splitlines() if "#" in line]
    does("Ida", "edit", "strawberry", "--set", f"{LIMIT}=113.5", why="riper fruit in August")
    assert [line for line in (site / "strawberry.yaml").read_text().splitlines() if "#" in line] == comments
    assert limit(book_of(site, home)) == (112.0, "1")
    assert "revision 2 waits" in does("Ida", "submit", "strawberry")
    code, output = station("recipes", "approve", "strawberry", "--who", " ida", "--reason", "x")
    assert code == 1
    assert "Ida is its author; another person has to approve it" in output
    assert limit(book_of(site, home)) == (112.0, "1")
    does("Bo", "approve", "strawberry", why="compared with lot 17")
    assert limit(book_of(site, home)) == (113.5, "2")
    output = station("recipes", "history", "strawberry")[1]
    assert f"{LIMIT}: 112.0 → 113.5" in output
    assert "approved by Bo" in output
    assert "compared with lot 17" in output
    does("Bo", "retire", "strawberry", why="the season is over")
    assert limit(book_of(site, home)) is None
    output = station("audit", "show", "--action", "recipe.", "--subject", "strawberry")[1]
    for action in ("recipe.adopted", "recipe.edited", "recipe.submitted", "recipe.approved", "recipe.retired"):
        assert action in output
    assert station("audit", "verify")[0] == 0


def test_the_papers_method_is_for_analyses_and_is_not_submitted_for_inspections(adopted, station, site, home):
    place = site / "strawberry.yaml"
    place.write_text(place.read_text().replace("method: robust", "method: paper"))
    assert station("recipes", "check", place)[0] == 0
    code, output = station("recipes", "submit", "strawberry", "--who", "Ida", "--reason", "x")
    assert (code, output) == (2, str(recipes.NOT_FOR_INSPECTIONS(recipe="strawberry")))
    assert [each.number for each in book_of(site, home)._store.history("strawberry")] == [1]


def test_a_hand_edit_is_noticed_shown_and_not_live(adopted, station, site, home):
    book = book_of(site, home)
    file = site / "strawberry.yaml"
    file.write_text(file.read_text().replace("area_mm2: 112\n", "area_mm2: 117\n"))
    book.refresh()
    assert limit(book) == (112.0, "1")
    (problem,) = book.problems
    assert problem.id == recipes.FILE_IS_CHANGED.id
    assert str(problem.parameters["changes"]) == f"{LIMIT}: 112.0 → 117.0"
    assert problem.parameters["stays"] == recipes.STAYS(revision=1)
    assert [entry.action for entry in book.take_noticed()] == ["recipe.file_noticed"]
    assert "strawberry: revision 1 in force" in station("recipes", "list")[1]
    assert station("recipes", "diff", "strawberry")[1] == f"{LIMIT}: 112.0 → 117.0\n"
    file.write_text("name: [")
    book.refresh()
    assert limit(book) == (112.0, "1")
    assert "strawberry.yaml:1: file: expected valid YAML" in "".join(map(str, book.problems))


def test_a_bad_edit_leaves_the_file_as_it_was(adopted, station, site):
    before = (site / "strawberry.yaml").read_bytes()
    for change, message in {
        f"{LIMIT}=300": "expected a number above 0 and at most 260 mm²",
        f"{LIMIT}=NO": "write",
        "early_stop.area_mm2=5": "no less than the largest damage threshold",
        "damage.area[7].area_mm2=5": "expected the path of a value",
        "damage.area[-1].area_mm2=113": "damage.area[-1].area_mm2: expected the path of a value",
        "damage area 0 area_mm2=113": "damage area 0 area_mm2: expected the path of a value",
        "damage.area[0]area_mm2=113": "expected the path of a value",
        "damage.area[0].area_mm2.=113": "expected the path of a value",
        "damage..area[0].area_mm2=113": "expected the path of a value",
        "=113": "expected the path of a value",
        "nonsense": "expected PATH=VALUE",
    }.items():
        code, output = station("recipes", "edit", "strawberry", "--set", change, "--who", "Ida", "--reason", "x")
        assert code == 2
        assert message in output
    assert (site / "strawberry.yaml").read_bytes() == before


def test_of_two_people_the_second_is_told_what_the_first_has_changed(adopted, station, does, site, tmp_path):
    ours, theirs = tmp_path / "ida.yaml", tmp_path / "bo.yaml"
    for file in (ours, theirs):
        assert station("recipes", "export", "strawberry", "--out", file)[0] == 0
    ours.write_text(ours.read_text().replace("area_mm2: 112\n", "area_mm2: 113\n"))
    theirs.write_text(theirs.read_text().replace("area_mm2: 112\n", "area_mm2: 110\n"))
    does("Ida", "import", ours)
    after_ida = (site / "strawberry.yaml").read_bytes()
    assert b"# base" not in after_ida
    code, output = station("recipes", "import", theirs, "--who", "Bo", "--reason", "x")
    assert code == 1
    assert f"to 9986814c3e22: {LIMIT}: 112.0 → 113.0" in output
    assert (site / "strawberry.yaml").read_bytes() == after_ida
    base = content_sha256(load_recipe(site / "strawberry.yaml"))[:12]
    does("Bo", "edit", "strawberry", "--set", f"{LIMIT}=114", "--base", base)
    code, output = station(
        "recipes", "edit", "strawberry", "--set", f"{LIMIT}=115", "--base", base, "--who", "Ida", "--reason", "x"
    )
    assert code == 1
    does("Bo", "submit", "strawberry")
    does("Cy", "edit", "strawberry", "--set", f"{LIMIT}=116")
    code, output = station("recipes", "submit", "strawberry", "--who", "Cy", "--reason", "x")
    assert code == 1
    assert f"revision 2 of Bo waits for approval, and differs from this one: {LIMIT}: 114.0 → 116.0" in output
    code, output = station("recipes", "approve", "strawberry", "--who", "Ida", "--reason", "x")
    assert code == 1
    assert f"file differs: {LIMIT}: 114.0 → 116.0" in output


def test_revert_puts_the_approved_text_back_and_keeps_what_stood_there(adopted, station, does, site, home):
    approved = (site / "strawberry.yaml").read_bytes()
    (site / "strawberry.yaml").write_text("what a mess")
    does("Ida", "revert", "strawberry")
    assert (site / "strawberry.yaml").read_bytes() == approved
    (backup,) = (home / "recipe_backups").iterdir()
    assert backup.read_text() == "what a mess"
    assert "file: approved" in station("recipes", "list")[1]


def test_what_would_break_another_recipes_file_is_refused_and_not_written(adopted, station, does, site, tmp_path):
    gooseberry = tmp_path / "gooseberry.yaml"
    gooseberry.write_text((site / "blueberry.yaml").read_text().replace("name: blueberry", "name: gooseberry"))
    does("Ida", "edit", "raspberry", "--set", "plc_number=9")
    does("Ida", "edit", "strawberry", "--set", "plc_number=3")
    exported = tmp_path / "strawberry.yaml"
    assert station("recipes", "export", "strawberry", "--out", exported)[0] == 0
    exported.write_text(exported.read_text().replace("plc_number: 3", "plc_number: 2"))

    def state():
        trail = station("audit", "show")[1]
        return {file.name: file.read_bytes() for file in site.iterdir()}, trail, station("recipes", "list")[1]

    before, clash = state(), "plc_number: expected one recipe with {}, but {} has it too"
    for arguments, number, other in (
        (("import", gooseberry), 2, "blueberry"),
        (("import", exported), 2, "blueberry"),
        (("edit", "strawberry", "--set", "plc_number=2"), 2, "blueberry"),
        (("revert", "raspberry"), 3, "strawberry"),
    ):
        code, output = station("recipes", *arguments, "--who", "Ida", "--reason", "x")
        assert (code, clash.format(number, site / f"{other}.yaml") in output) == (2, True), output
        assert state() == before
    code, output = station("recipes", "edit", "strawberry", "--set", "name=blueberry", "--who", "Ida", "--reason", "x")
    assert code == 2
    assert f"name: expected one recipe with blueberry, but {site / 'blueberry.yaml'} has it too" in output
    assert state() == before


def test_two_recipes_never_share_the_plcs_number(adopted, station, does, site):
    (site / "raspberry.yaml").unlink()
    does("Ida", "edit", "blueberry", "--set", "plc_number=3")
    does("Ida", "submit", "blueberry")
    code, output = station("recipes", "approve", "blueberry", "--who", "Bo", "--reason", "x")
    assert code == 1
    assert "its PLC number 3 is that of the approved raspberry" in output


def test_number_name_and_content_have_to_belong_together(adopted, does, site, home):
    book = book_of(site, home)
    strawberry = book.find(1)
    assert strawberry is not None
    assert book.current(strawberry) == strawberry
    does("Ida", "edit", "strawberry", "--set", "plc_number=9")
    does("Ida", "submit", "strawberry")
    does("Bo", "approve", "strawberry")
    book.refresh()
    with pytest.raises(RecipeStoreError) as moved:
        book.current(strawberry)
    assert moved.value.message == recipes.MOVED(recipe="strawberry", now=9, before=1)
    does("Bo", "retire", "strawberry")
    book.refresh()
    with pytest.raises(RecipeStoreError) as gone:
        book.current(strawberry)
    assert gone.value.message == recipes.GONE(recipe="strawberry", number=1)


def test_a_lot_goes_on_over_a_restart_only_with_what_its_revision_says(adopted, does, site, home):
    book = book_of(site, home)
    first = book.find(1)
    assert first is not None
    assert book.store_active(first, "A-17")
    does("Ida", "edit", "strawberry", "--set", f"{LIMIT}=113")
    does("Ida", "submit", "strawberry")
    does("Bo", "approve", "strawberry")
    assert book_of(site, home).restored() == (first, "A-17"), "the lot began with revision 1"
    stored = home / "active_recipe.json"
    stored.write_text(stored.read_text().replace("112.0", "117.0"))
    remembered = book_of(site, home).restored()
    assert remembered is not None
    assert (remembered.lot, remembered.active.snapshot.revision) == (None, "2"), "what was tampered with is not used"


def test_what_was_in_force_stays_so_without_the_database(adopted, does, site, home):
    assert limit(book_of(site, home)) == (112.0, "1")
    file = site / "strawberry.yaml"
    file.write_text(file.read_text().replace("area_mm2: 112\n", "area_mm2: 117\n"))
    (home / "records" / "records.sqlite3").write_bytes(b"no database at all" * 1000)
    assert limit(book_of(site, home)) == (112.0, "1"), "a damaged one"
    shutil.rmtree(home / "records")
    book = book_of(site, home)
    assert limit(book) == (112.0, "1"), "a lost one: the hand edit does not slip in"
    assert recipes.FILE_IS_CHANGED.id in {problem.id for problem in book.problems}


def test_a_full_or_read_only_disk_changes_nothing(adopted, station, does, tmp_path, site, home, monkeypatch):
    disk = tmp_path / "disk"
    disk.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", disk], capture_output=True, check=False)
    if done.returncode:
        pytest.skip("this user may not mount a small disk")
    try:
        folder = disk / "recipes"
        shutil.copytree(site, folder)
        monkeypatch.setenv("STATION_RECIPES_FOLDER", str(folder))
        before, edit = (folder / "strawberry.yaml").read_bytes(), ("edit", "strawberry", "--set", f"{LIMIT}=113")
        with (disk / "filler").open("wb", buffering=0) as filler:
            try:
                while True:
                    filler.write(bytes(1024))
            except OSError:
                pass
        code, output = station("recipes", *edit, "--who", "Ida", "--reason", "x")
        assert code == 1
        assert "cannot be written: No space left on device" in output
        (disk / "filler").unlink()
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        code, output = station("recipes", *edit, "--who", "Ida", "--reason", "x")
        assert code == 1
        assert "Read-only file system" in output
        assert (folder / "strawberry.yaml").read_bytes() == before
        assert sorted(os.listdir(folder)) == sorted(os.listdir(site)), "no unfinished file is left"  # noqa: PTH208
        assert "recipe.edited" not in station("audit", "show")[1]
        assert limit(book_of(folder, home)) == (112.0, "1")
    finally:
        subprocess.run(["umount", "--lazy", disk], check=True)


EDIT = ("recipes", "edit", "strawberry", "--set", f"{LIMIT}=113", "--who", "Ida", "--reason", "x")


def _full(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_an_edit_whose_audit_row_cannot_be_written_leaves_the_file(adopted, station, site, monkeypatch):
    before, files = (site / "strawberry.yaml").read_bytes(), sorted(site.iterdir())

    def commit(_dialect, connection):
        return _full() if connection.total_changes else connection.commit()

    with monkeypatch.context() as patch:
        patch.setattr(DefaultDialect, "do_commit", commit)
        assert station(*EDIT)[0] == 1
    assert (site / "strawberry.yaml").read_bytes() == before
    assert sorted(site.iterdir()) == files
    assert "recipe.edited" not in station("audit", "show")[1]


def test_the_audit_trail_says_that_an_edited_file_could_not_be_written(adopted, station, site, monkeypatch):
    before, files = (site / "strawberry.yaml").read_bytes(), sorted(site.iterdir())
    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", _full)
        code, output = station(*EDIT)
    assert code == 1
    assert "cannot be written: No space left on device" in output
    assert (site / "strawberry.yaml").read_bytes() == before
    assert sorted(site.iterdir()) == files
    output = station("audit", "show", "--action", "recipe.", "--last", "2")[1]
    assert output.index("recipe.edited") < output.index("recipe.not_written")
    assert "No space left on device" in output


def test_an_edited_file_that_is_in_place_and_may_not_be_durable_is_not_called_unchanged(
    adopted, station, site, monkeypatch, caplog
):
    def failing(_folder):
        raise OSError(errno.EIO, "Input/output error")

    with monkeypatch.context() as patch:
        patch.setattr(files, "sync_folder", failing)
        code, output = station(*EDIT)
    assert code == 0, output
    assert load_recipe(site / "strawberry.yaml").damage.area[0].area_mm2 == 113
    (warning,) = [record.getMessage() for record in caplog.records if record.name == files.__name__]
    assert "strawberry.yaml: written, but a loss of power may bring the former file back: " in warning
    assert "recipe.not_written" not in station("audit", "show")[1]


def test_nothing_of_an_edit_waits_for_the_disk_while_the_station_cannot_write(
    adopted, station, site, home, monkeypatch
):
    """In the transaction another writer is locked out: with the new file in place, the row has to be durable."""
    rows = []
    put = Path.replace

    def seen(new, path):
        connection = sqlite3.connect(home / "records" / "records.sqlite3", timeout=0)
        connection.execute("BEGIN IMMEDIATE")
        rows.extend(connection.execute("SELECT action FROM audit ORDER BY seq DESC LIMIT 1"))
        connection.rollback()
        connection.close()
        return put(new, path)

    monkeypatch.setattr(Path, "replace", seen)
    assert station(*EDIT)[0] == 0
    assert rows == [("recipe.edited",)]


def test_the_shipped_files_are_not_edited_in_place(adopted, station, monkeypatch):
    monkeypatch.delenv("STATION_RECIPES_FOLDER")
    code, output = station("recipes", "edit", "strawberry", "--set", f"{LIMIT}=1", "--who", "Ida", "--reason", "x")
    assert code == 1
    assert "copy them into a folder of the site's" in output


@pytest.mark.parametrize(
    ("arguments", "exit_code", "message"),
    [
        (("submit", "cherry"), 2, "expected one of blueberry"),
        (("submit", "strawberry"), 1, "revision 1, which is approved already"),
        (("approve", "strawberry"), 2, "no draft waits"),
        (("retire", "strawberry", "--revision", "9"), 2, "revision 9: expected one of 1"),
        (("import", "none.yaml"), 2, "expected a readable file"),
    ],
)
def test_what_cannot_be_done_is_told(adopted, station, arguments, exit_code, message):
    code, output = station("recipes", *arguments, "--who", "Ida", "--reason", "x")
    assert code == exit_code
    assert message in output


def test_the_hash_is_the_snapshots(site):
    recipe = load_recipe(site / "strawberry.yaml")
    snapshot = RecipeSnapshot.of(recipe.model_dump(mode="json"))
    assert content_sha256(recipe) == snapshot.sha256
    assert json.loads(snapshot.text) == recipe.model_dump(mode="json")
