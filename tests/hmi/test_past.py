"""History, lots, recipes and alarms of the past: read by the pages' own process, also while the station is away."""

import asyncio
import html
import json
import re
from pathlib import Path

import pytest

from hmi.web.app import make_context
from hmi.web.roles import Role
from station.inspection.alarm_table import ALARMS, AlarmId
from station.recipe_store.history import Person, submit
from station.recipe_store.store import RecipeStore
from station.records.audit import AuditEntry, append_audit
from station.records.direct_transaction import direct_transaction
from station.records.lots import start_lot
from station.records.model import AlarmEntry, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.settings.configuration import load_configuration
from station.settings.recipe import find_recipe, shipped_folder
from station.settings.records import RecordsSettings
from tests.hmi.test_security import log_in


@pytest.fixture
def fruit(tmp_path: Path) -> int:
    """A rejected fruit of a lot, in the records of a station that has ended; its number."""

    async def inspected() -> int:
        records = await Records.open(tmp_path / "records", RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "boot")
        try:
            recipe = RecipeSnapshot.of(find_recipe("strawberry").model_dump(mode="json"))
            trigger = Trigger(7, 1234, "A-17", 1_700_000_000_000, recipe, True)
            sequence = await records.begin(trigger)
            judged = InspectionRecord(
                "FAIL", ("area_over_limit",), (), False, False, 170.0, 44_500, 4.0, 0.9, 1_700_000_003_210, 3210
            )
            await records.conclude(sequence, judged)
            await records.change(lambda connection: start_lot(connection, "A-17", "Meadow Farm", ("Ida", "operator")))
            return sequence
        finally:
            await records.close()

    return asyncio.run(inspected())


def test_history_lots_and_audit_trail_are_there_while_the_station_is_away(pages, fruit):
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        status, _, body = pages("GET", f"/history/{fruit}")
        assert (status, b"Contact area over the limit" in body) == (200, True)
        status, _, body = pages("GET", "/history?lot=A-17")
        assert (status, f"/history/{fruit}".encode() in body) == (200, True)
        status, _, body = pages("GET", "/history/audit")
        assert (status, b"Meadow Farm" in body) == (200, True)
        whole = json.loads(pages("GET", f"/api/v1/inspections/{fruit}")[2])
        assert (whole["outcome"], whole["lot"]) == ("FAIL", "A-17")
        assert json.loads(pages("GET", "/api/v1/lots/A-17")[2])["grower"] == "Meadow Farm"


@pytest.mark.parametrize("in_home", [False, True])
def test_a_lots_report_made_at_the_pages_names_its_station_also_while_its_file_is_broken(
    fruit, tmp_path, tmp_path_factory, monkeypatch, in_home
):
    """The file of an installed station is not in its home folder."""
    file = (tmp_path if in_home else tmp_path_factory.mktemp("etc")) / "station.yaml"
    file.write_text("outbox: {station: line-7}")
    monkeypatch.setenv("STATION_CONFIG", str(file))
    monkeypatch.setenv("STATION_HOME", str(tmp_path))
    jobs = make_context(load_configuration(), file, "").jobs
    file.write_text("outbox: [")

    async def reported() -> str:
        folder = jobs.folder()
        job = jobs.begin("lot_report", folder, ["records", "report", "--", "A-17", str(folder / "lot.html")])
        assert job.task is not None
        await job.task
        assert job.state == "done", job.message
        return (folder / "lot.html").read_text(encoding="utf-8")

    report = asyncio.run(reported())
    assert "A-17" in report
    assert "line-7" in report


def test_a_draft_that_this_program_refuses_is_shown_so_that_it_can_be_rejected(pages, tmp_path):
    """Submitted to an earlier program."""
    RecipeStore(tmp_path, None).begin({})
    recipe, text = find_recipe("raspberry"), (shipped_folder() / "raspberry.yaml").read_text(encoding="utf-8")
    text = text.replace("least_area_mm2: 31", "least_area_mm2: 70")
    with direct_transaction(tmp_path / "records") as connection:
        submit(connection, text, recipe.model_copy(update={"title": "Another"}), Person("Ida", "quality", "softer"))
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        status, _, body = pages("GET", "/recipes/raspberry")
        assert status == 200
        assert b"his program does not accept that revision any more: raspberry@2:" in body
        assert b"No difference from the recipe in force" not in body
        assert b"/recipes/raspberry/reject" in body


def test_what_was_typed_for_an_order_that_got_no_answer_is_shown_again(pages, tmp_path):
    RecipeStore(tmp_path, None).begin({})
    recipe, text = find_recipe("raspberry"), (shipped_folder() / "raspberry.yaml").read_text(encoding="utf-8")
    with direct_transaction(tmp_path / "records") as connection:
        submit(connection, text, recipe.model_copy(update={"title": "Another"}), Person("Ida", "quality", "softer"))
    draft = {"v:damage.area[0].area_mm2": "77,5", "base": "0" * 64}
    reason = 'name="reason" value="a firmer variety"'
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        for path, fields, typed in (
            ("strawberry/draft", draft, 'value="77,5"'),
            ("raspberry/approve", {"revision": "2"}, reason),
            ("raspberry/reject", {"revision": "2"}, reason),
            ("strawberry/revert", {"revision": "1"}, reason),
        ):
            order = {**fields, "reason": "a firmer variety", "csrf": pages.token()}
            status, _, body = pages.post(f"/recipes/{path}", **order)
            assert (status, b"The station did not answer in time" in body) == (503, True), path
            assert typed in body.decode(), path
        # As the author sends it again, whose first try was carried out after all.
        order = {"reason": "a firmer variety", "csrf": pages.token()}
        status, _, body = pages.post("/recipes/raspberry/submit", **order)
        assert (status, b'action="/recipes/raspberry/approve"' in body) == (503, True)
        assert b"a firmer variety" not in body


def test_recipes_their_history_and_past_curves_are_there_while_the_station_is_away(pages, fruit, tmp_path):
    RecipeStore(tmp_path, None).begin({})
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        status, _, body = pages("GET", "/recipes")
        assert (status, b"Revision 1 in force" in body) == (200, True)
        status, _, body = pages("GET", "/recipes/strawberry")
        assert (status, b"No difference from the recipe in force" in body) == (200, True)
        assert b"1 failed" in body, "the fruit's curve is drawn"
        status, _, body = pages("GET", "/recipes/strawberry/history")
        assert (status, b"Shipped by" in body) == (200, True)
        status, _, body = pages("GET", "/recipes/strawberry/text?revision=1")
        assert (status, b"plc_number" in body) == (200, True)
        assert b"# base: sha256" in pages("GET", "/recipes/strawberry/export")[2]
        assert pages("GET", "/recipes/strawberry/edit")[0] == 200
        assert pages("GET", "/recipes/banana/edit")[0] == 404
        status, _, body = pages("GET", "/recipes/strawberry/text?revision=7")
        assert (status, b"7" in body) == (409, True)
        whole = json.loads(pages("GET", "/api/v1/recipes/strawberry")[2])
        assert (whole["revision"], whole["values"]["name"]) == (1, "strawberry")


def test_changes_of_alarms_are_there_while_the_station_is_away(pages, tmp_path):
    async def change() -> None:
        records = await Records.open(tmp_path / "records", RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "boot")
        try:
            entries = [AlarmEntry(1, "camera_lost", "raised", "USB"), AlarmEntry(2, "of_another_version", "cleared")]
            await records.save_alarms([], entries)
        finally:
            await records.close()

    asyncio.run(change())
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        status, _, body = pages("GET", "/alarms/history")
        assert (status, b"USB" in body, b"of_another_version" in body) == (200, True, True)
        assert f"<b>{ALARMS[AlarmId.CAMERA_LOST].number}</b>".encode() in body


def test_the_audit_trail_and_the_history_of_alarms_continue_on_older_pages(pages, tmp_path):
    async def fill() -> None:
        records = await Records.open(tmp_path / "records", RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "boot")
        try:
            entries = [AuditEntry(f"Ida {n:03}", "operator", "lot.told", f"lot A-{n}") for n in range(1, 102)]
            await records.change(lambda connection: [append_audit(connection, entry) for entry in entries])
            await records.audit(AuditEntry("Bo", "operator", "lot.told", "lot B"))
            await records.save_alarms(
                [], [AlarmEntry(n, "camera_lost", "raised", f"USB {n:03}") for n in range(1, 102)]
            )
        finally:
            await records.close()

    asyncio.run(fill())
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        for path, terms, name in (("/history/audit", "?action=lot.&subject=A-", "Ida"), ("/alarms/history", "", "USB")):
            first = pages("GET", path + terms)[2].decode()
            assert sorted(set(re.findall(rf"{name} (\d+)", first))) == [f"{n:03}" for n in range(2, 102)]
            (older,) = re.findall(r'href="(\?[^"]*below=\d+)"', first)
            last = pages("GET", path + html.unescape(older))[2].decode()
            assert set(re.findall(rf"{name} (\d+)", last)) == {"001"}
            assert "below=" not in last


def test_a_fruit_that_was_never_judged_has_a_page_too(pages, tmp_path):
    async def begin() -> int:
        records = await Records.open(tmp_path / "records", RecordsSettings(deadline_s=20.0, free_reserve_mb=1), "boot")
        try:
            return await records.begin(Trigger(7, 1234, "A-17", 1_700_000_000_000, None, True))
        finally:
            await records.close()

    sequence = asyncio.run(begin())
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        status, _, body = pages("GET", f"/history/{sequence}")
        assert (status, b"A-17" in body) == (200, True)
        whole = json.loads(pages("GET", f"/api/v1/inspections/{sequence}")[2])
        assert (whole["outcome"], whole["curve"], whole["recipe"]) == (None, [], "")


def test_a_fruit_that_there_is_not_is_said(pages, fruit):
    with pages.context.past:
        log_in(pages, "Ana", Role.ADMIN)
        status, _, body = pages("GET", f"/history/{fruit + 1}")
        assert (status, b"no inspection" in body.lower()) == (409, True)
        status, _, body = pages("GET", f"/api/v1/inspections/{fruit + 1}")
        assert (status, f"no inspection {fruit + 1}" in json.loads(body)["detail"].lower()) == (404, True)
        assert "there is no lot NO" in json.loads(pages("GET", "/api/v1/lots/NO")[2])["detail"]
        assert json.loads(pages("GET", "/api/v1/nothing")[2])["detail"] == "This page does not exist."


def test_without_records_the_page_says_so(pages):
    with pages.context.past:
        status, _, body = pages("GET", "/history/1")
        assert status == 409
        assert b"records.sqlite3" in body
