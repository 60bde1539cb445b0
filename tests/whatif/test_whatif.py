"""The what-if: a stored inspection judged by a draft ends as the station would have ended it, or is not guessed."""

import csv
import json
import sqlite3
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from station.commands.whatif import _changes
from station.errors import StationError
from station.inspection.fruit_size import NO_SIZE, FruitSize
from station.inspection.judge import judge
from station.messages import whatif as messages
from station.messages.judge import AREA_NEAR, INTERNAL_FAULT, STEPS_ENDED
from station.messages.message import VERBATIM, verbatim
from station.records.database import FILE_NAME, reading
from station.settings.recipe import find_recipe
from station.vocabulary import Reason
from station.whatif import runner
from station.whatif.outcome_table import as_csv, counted
from station.whatif.page import fruit_views
from station.whatif.progress_file import ProgressFile
from station.whatif.replay import Replayed, replay
from station.whatif.stored import StoredPress, read_stored, snapshots_of

SOUND, BRUISED, BETWEEN = 27.0, 45.0, 33.5


def stored_of(press, recipe, sequence=1):
    return StoredPress(sequence, "A", judge(press, recipe).outcome, "x", press)


def test_the_own_recipe_gives_what_is_stored(orchard):
    for growth in (20.0, SOUND, BETWEEN, BRUISED, 60.0):
        stored = stored_of(orchard.press(growth), orchard.recipe)
        replayed = replay(stored, orchard.recipe, orchard.recipe)
        assert replayed.faithful
        assert replayed.after == stored.before
        assert replayed.changes_side == ""


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60, deadline=None)
@given(
    growth=st.floats(15, 60),
    limit=st.floats(80, 118),
    growth_limit=st.floats(30, 55),
    stop=st.floats(118, 250),
    seed=st.integers(0, 9),
)
def test_a_verdict_on_a_stored_curve_is_that_of_the_fruit_pressed_by_the_draft(
    orchard, changed, growth, limit, growth_limit, stop, seed
):
    """Each verdict that is reported as decided is right: the same fruit pressed by the draft has the same outcome."""
    own = orchard.recipe
    values = {"damage__area__0__area_mm2": limit, "damage__growth_mm2_per_mm": growth_limit}
    draft = changed(own, early_stop__area_mm2=stop, early_stop__growth_mm2_per_mm=max(55.0, growth_limit), **values)
    replayed = replay(stored_of(orchard.press(growth, seed=seed), own), own, draft)
    orchard.recipe = draft
    truth = judge(orchard.press(growth, seed=seed), draft).outcome
    orchard.recipe = own
    if replayed.after != "UNDECIDABLE":
        assert (replayed.after == "PASS") == (truth == "PASS")


def test_a_curve_that_was_stopped_early_does_not_tell_what_would_have_come(orchard, changed):
    stored = stored_of(orchard.press(SOUND), orchard.recipe)
    assert stored.before == "PASS"
    assert len(stored.press.points) < orchard.recipe.steps.number, "it was stopped early"
    further = changed(orchard.recipe, early_stop__area_mm2=200.0)
    replayed = replay(stored, orchard.recipe, further)
    assert replayed.after == "UNDECIDABLE"
    assert replayed.why == messages.CURVE_STOPPED(reached_mm=stored.press.points[-1].closing_mm)
    stricter = changed(further, damage__area__0__area_mm2=62.0, damage__area__0__least_area_mm2=20.0)
    assert replay(stored, orchard.recipe, stricter).after == "FAIL", "what is proven remains, with any further steps"
    near = changed(further, damage__area__0__area_mm2=stored.press.points[3].area_mm2 + 1)
    replayed = replay(stored, orchard.recipe, near)
    assert (replayed.after, replayed.why and replayed.why.id) == ("NO_RESULT", AREA_NEAR.id), "it cannot pass"


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"steps__step_mm": 1.02}, messages.PRESSES_OTHERWISE(fields="steps.step_mm")),
        (
            {"gripper__speed_mm_s": 30.0, "imaging__settle_s": 0.5},
            messages.PRESSES_OTHERWISE(fields="gripper, imaging"),
        ),
        ({"press": {"centre_from_mm": 2.5}}, messages.PRESSES_OTHERWISE(fields="press.centre_from_mm")),
        ({"segmentation__robust__gate_ratio": 4.0}, messages.IMAGES_NOT_KEPT()),
        ({"segmentation__robust__least_confidence": 0.3}, messages.IMAGES_NOT_KEPT()),
    ],
)
def test_what_no_stored_curve_can_tell_is_not_guessed(orchard, changed, changes, why):
    own = orchard.recipe
    replayed = replay(stored_of(orchard.press(SOUND), own), own, changed(own, **changes))
    assert replayed.after == "UNDECIDABLE"
    assert replayed.why == why


@pytest.mark.parametrize(
    ("message", "interrupted"),
    [
        (STEPS_ENDED(reached_mm=2.0, wanted_mm=4.0), False),
        (INTERNAL_FAULT(), True),
        (verbatim("The steps ended at 2.0 mm of closing, before 4 mm, and nothing says why."), True),
    ],
)
def test_steps_that_ended_for_no_known_reason_are_no_fault_of_the_program(orchard, message, interrupted):
    (sequence,) = orchard.store([orchard.press(SOUND)])
    stored = message.parameters["text"] if message.id == VERBATIM.id else message.model_dump(mode="json")
    with closing(sqlite3.connect(orchard.folder / FILE_NAME)) as database, database:
        database.execute(
            "UPDATE inspections SET reasons = ?, explanation = ?",
            (json.dumps([Reason.INTERNAL_FAULT]), json.dumps([stored])),
        )
    with reading(orchard.folder) as connection:
        (read,) = read_stored(connection, [sequence], orchard.folder, with_images=False)
    assert read.press.interruptions == ((Reason.INTERNAL_FAULT,) if interrupted else ())


def test_why_results_are_unknown_is_counted_whatever_their_figures(tmp_path, orchard):
    results = [
        Replayed(n, "A", "PASS", "UNDECIDABLE", messages.CURVE_ENDS(reached_mm=n / 2), faithful=True) for n in range(3)
    ]
    why = "the curve ends at … mm of closing, and the draft would have pressed on"
    assert counted(results).summary()["undecidable_because"] == {why: 3}
    with ProgressFile(tmp_path, orchard.recipe) as progress:
        progress.add(results)
    with ProgressFile(tmp_path, orchard.recipe) as progress:
        assert progress.done == {each.sequence: each for each in results}


def test_an_interrupted_inspection_stays_no_result_and_an_unknown_recipe_is_said(orchard, changed):
    stored = stored_of(orchard.press(SOUND, Reason.ARM_FAULT), orchard.recipe)
    assert stored.before == "NO_RESULT"
    assert replay(stored, orchard.recipe, changed(orchard.recipe, early_stop__area_mm2=200.0)).after == "NO_RESULT"
    assert replay(stored, None, orchard.recipe).after == "UNDECIDABLE"


def test_a_stored_press_is_judged_again_with_its_size_scale_and_gripper(orchard):
    press = replace(orchard.press(SOUND), size=FruitSize(41.5, 3), scale_uncertainty=0.0125, resolution_mm=0.375)
    made = orchard.store([press, orchard.press(SOUND)])
    with reading(orchard.folder) as connection:
        sized, plain = read_stored(connection, made, orchard.folder, with_images=False)
    assert judge(sized.press, orchard.recipe).budget == judge(press, orchard.recipe).budget
    assert (sized.press.size, plain.press.size) == (FruitSize(41.5, 3), NO_SIZE)


def test_no_lot_is_a_formula_in_the_table_of_changes():
    changed = Replayed(1, "=1+1", "PASS", "FAIL", None, faithful=True)
    (row,) = csv.DictReader(as_csv([changed]).splitlines())
    assert row["lot"] == "'=1+1"


def test_the_command_shows_which_fruit_change_sides_and_goes_on_where_it_was(orchard, draft, station, tmp_path):
    orchard.store([orchard.press(growth, seed=7) for growth in (SOUND, BRUISED, BETWEEN)], "A")
    orchard.store([orchard.press(SOUND)], "B")
    file, out = draft(damage__area__0__area_mm2=90.0), tmp_path / "out"
    code, output = station("whatif", "--recipe", file, "--lots", "A", "--out", out, "--jobs", 1)
    assert code == 0
    assert "3 inspections, 3 decided by the draft" in output
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["rejects_before"], summary["rejects_after"], summary["newly_rejected"]) == (1, 2, 1)
    assert summary["not_reproduced"] == 0
    (row,) = [row for row in csv.DictReader((out / "changes.csv").read_text().splitlines()) if row["changes_side"]]
    assert (row["sequence"], row["lot"], row["before"], row["changes_side"]) == ("3", "A", "PASS", "rejected")
    page = (out / "whatif.html").read_text()
    assert "1 newly diverted, 0 newly passed" in page
    assert "damage.area[0].area_mm2: 112.0 → 90.0" in page
    assert "http" not in page.replace("http://www.w3.org", ""), "it needs no network"
    lines = (out / "replayed.jsonl").read_text()
    (out / "replayed.jsonl").write_text(lines + '{"sequence": 4, "lo')  # a crash in the middle of a line
    code, output = station("whatif", "--recipe", file, "--out", out, "--jobs", 1)
    assert code == 0
    assert "4 inspections" in output
    again = (out / "replayed.jsonl").read_text()
    assert again.startswith(lines)
    assert again.count("\n") == lines.count("\n") + 1
    assert summary["marked"] is None, "no fruit is marked good or bad"
    assert station("records", "mark", 1, 3, "good")[0] == station("records", "mark", 2, "bad")[0] == 0
    code, output = station("whatif", "--recipe", file, "--out", out, "--jobs", 1)
    assert "marked good and diverted: 0 of 2 (0.0 to 84.2 %) before, 1 of 2 (1.3 to 98.7 %) after" in output
    assert "marked bad and passed: 0 of 1 (0.0 to 97.5 %) before, 0 of 1 (0.0 to 97.5 %) after" in output
    assert "now wrong: 3" in output
    assert "now wrong: 3" in (out / "whatif.html").read_text()
    assert json.loads((out / "summary.json").read_text())["marked"]["now_wrong"] == [3]
    code, output = station("whatif", "--recipe", draft(damage__area__0__area_mm2=91.0), "--out", out)
    assert code == 2
    assert "it holds the results of another draft" in output


def test_the_draft_is_compared_with_the_revision_that_inspected_these_fruit(orchard, draft, changed, station, tmp_path):
    made = orchard.store([orchard.press(SOUND)], "A")
    other = replace(orchard, recipe=changed(orchard.recipe, damage__area__0__area_mm2=100.0))
    made += other.store([orchard.press(SOUND)], "B")
    with reading(orchard.folder) as connection:
        first, second = snapshots_of(connection, made)
        assert list(snapshots_of(connection, made[1:])) == [second]
    file, pages = draft(damage__area__0__area_mm2=90.0), {}
    for name, lots in (("A", ("--lots", "A")), ("B", ("--lots", "B")), ("both", ())):
        assert station("whatif", "--recipe", file, *lots, "--out", tmp_path / name, "--jobs", 1)[0] == 0
        pages[name] = (tmp_path / name / "whatif.html").read_text()
    assert "damage.area[0].area_mm2: 112.0 → 90.0" in pages["A"]
    assert "damage.area[0].area_mm2: 100.0 → 90.0" in pages["B"]
    assert "were inspected by 2 revisions" in pages["both"]
    assert "damage.area[0].area_mm2:" not in pages["both"]
    shown = {name: (first[:12] in page, second[:12] in page) for name, page in pages.items()}
    assert shown == {"A": (True, False), "B": (False, True), "both": (True, True)}


def test_a_recipe_that_is_not_accepted_any_more_is_compared_with_nothing(orchard):
    assert "does not accept" in str(_changes([None], orchard.recipe))
    assert _changes([orchard.recipe], orchard.recipe) == ()


def test_each_fruit_is_drawn_beside_the_limits_for_its_size(orchard, changed, monkeypatch):
    recipe = find_recipe("strawberry")
    assert recipe.damage.size is not None
    (sequence,) = replace(orchard, recipe=recipe).store([replace(orchard.press(SOUND), size=FruitSize(36.0))])
    drawn = []
    monkeypatch.setattr("station.whatif.page.area_chart", lambda _curves, limits, *_, **__: drawn.extend(limits) or "")
    draft = changed(recipe, damage__area__1__area_mm2=110.0)
    result = Replayed(sequence, "A", "PASS", "FAIL", None, faithful=True)
    with reading(orchard.folder) as connection:
        recipes = dict.fromkeys(snapshots_of(connection, [sequence]), recipe)
        assert len(fruit_views(connection, orchard.folder, [result], recipes, draft)) == 1
        assert fruit_views(connection, orchard.folder, [], recipes, draft) == []
    factor = (36.0 / recipe.damage.size.reference_mm) ** recipe.damage.size.exponent
    assert factor < 0.9
    assert [(each.former, each.closing_mm, each.area_mm2) for each in drawn] == [
        (former, each.closing_mm, pytest.approx(factor * each.area_mm2))
        for former, of in ((True, recipe), (False, draft))
        for each in of.damage.area
    ]


def test_two_processes_and_a_cluster_say_the_same_as_one(orchard, draft, station, apart, cluster, tmp_path):
    orchard.store([orchard.press(20.0 + number / 2, seed=number) for number in range(60)])
    file = draft(damage__area__0__area_mm2=75.0)
    assert station("whatif", "--recipe", file, "--out", tmp_path / "one", "--jobs", 1)[0] == 0
    for name, how in {"two": ("--jobs", 2), "cluster": ("--scheduler", cluster)}.items():
        code, output = apart("whatif", "--recipe", file, "--out", tmp_path / name, *how)
        assert code == 0, output
    one, two, many = (json.loads((tmp_path / name / "summary.json").read_text()) for name in ("one", "two", "cluster"))
    assert one == two == many
    assert one["newly_rejected"] > 0


def test_a_process_that_is_killed_is_told_with_how_to_go_on():
    def lost(_part):
        future = Future()
        future.set_exception(BrokenProcessPool("killed"))
        return future

    with pytest.raises(StationError, check=lambda error: error.message == messages.PROCESS_ENDED()):
        list(runner._flow([None, None], lost, 1))  # pyrefly: ignore[bad-argument-type] (no part is used)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--lots", "Z"), "no judged inspection of strawberry"),
        (("--recipe", "none.yaml"), "expected a readable file"),
        (("--scheduler", "nonsense"), "expected tcp://HOST:PORT"),
        (("--scheduler", "tcp://127.0.0.1:1"), "no Dask scheduler answers there"),
    ],
)
def test_bad_input_is_told(orchard, draft, station, tmp_path, arguments, message):
    orchard.store([orchard.press(SOUND)])
    code, output = station("whatif", "--recipe", draft(), "--out", tmp_path / "out", *arguments)
    assert code == 2
    assert message in output
