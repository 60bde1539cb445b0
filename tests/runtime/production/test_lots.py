"""A lot keeps the recipe that it began with while people change the recipes; all of it is in the audit trail."""

import asyncio
import threading
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.client import ChannelClient
from station.channel.line import Begin, BeginReply, CommandName
from station.channel.messages import DeadlineError
from station.channel.panel import Actor
from station.channel.panel_run import (
    Counts,
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.inspection.states import State
from station.messages import lots, readiness, recipes
from station.messages import records as records_messages
from station.messages.message import message_of
from station.recipe_store.editor import RecipeEditor
from station.recipe_store.history import Person
from station.recipe_store.store import RecipeStore
from station.records.audit_check import check_audit
from station.records.audit_head import read_head
from station.records.audit_report import read_audit
from station.records.database import reading, records_folder
from station.records.errors import DiskFullError
from station.records.lots import read_lots
from station.runtime.production import operator_commands
from station.runtime.production.lots import LotManager
from station.settings.hmi import panel_endpoint
from station.state_files import StateFiles
from station.vocabulary import Reason, Refusal
from tests.quick_recipes import NUMBERS
from tests.stored_inspection import read_record

IDA, BO = Person("Ida", "quality", "riper"), Person("Bo", "quality", "looked at lot 17")


def test_edits_and_approvals_within_a_lot_concern_the_next_one(bench):
    async def scenario():
        async with bench() as cell:
            home, folder = cell.configuration.home, cell.configuration.recipes_folder
            editor, store = RecipeEditor(home, folder), RecipeStore(home, folder)

            def set_limit(value):
                editor.edit("blueberry", {"damage.growth_mm2_per_mm": value}, IDA)

            def put_in_force():
                store.submit("blueberry", IDA)
                store.approve("blueberry", BO)

            await cell.choose("blueberry")
            first = await cell.line.inspect()
            await asyncio.to_thread(set_limit, 55.0)
            cell.lay("blueberry")
            assert (await cell.line.inspect()).recipe_checksum == first.recipe_checksum, "a draft is not live"
            await asyncio.to_thread(put_in_force)
            cell.lay("blueberry", 2)
            assert (await cell.line.inspect()).recipe_checksum == first.recipe_checksum, "the lot goes on"
            await asyncio.to_thread(cell.station.recipes.refresh)

            reply = await begin(cell, 900, "LOT 2")
            assert reply.refusal is None
            second = await cell.line.outcome(reply.sequence)
            await cell.line.publish(second)
            assert second.recipe_checksum != first.recipe_checksum
            record = read_record(cell.station.service.registry.records, second.sequence)
            assert record.trigger.recipe.revision == "2"

            await asyncio.to_thread(store.retire, "blueberry", BO)
            await asyncio.to_thread(cell.station.recipes.refresh)
            await cell.line.ready()
            assert (await begin(cell, 901, "LOT 3")).refusal is Refusal.NOT_READY
            why = (await cell.line.state()).why_not_ready
            gone = recipes.GONE(recipe="blueberry", number=2)
            assert why.parameters["sentences"][0] == lots.REFUSED(lot="LOT 3", why=gone)
            assert (await cell.line.order(CommandName.CHANGE_RECIPE, 1)).done
            return records_folder(home)

    folder = asyncio.run(scenario())
    with reading(folder) as connection:
        actions = [row.action for row in read_audit(connection, 100)]
        assert check_audit(connection, read_head(folder)).broken == ()
    assert actions.count("lot.started") == 2
    assert actions.count("lot.refused") == 1
    for action in ("service.started", "service.ended", "command.change_recipe", "recipe.approved", "recipe.retired"):
        assert action in actions


def test_a_trigger_during_whose_lots_begin_the_mode_was_changed_is_refused(bench, monkeypatch):
    storing, stored = threading.Event(), threading.Event()

    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            recipes = cell.station.recipes
            store_active = recipes.store_active

            def slow(*of):
                storing.set()
                assert stored.wait(60)
                return store_active(*of)

            monkeypatch.setattr(recipes, "store_active", slow)
            beginning = asyncio.create_task(begin(cell, 900, "LOT 2"))
            assert await asyncio.to_thread(storing.wait, 60)
            assert (await cell.line.order(CommandName.SET_MODE, 3)).done
            stored.set()
            assert (await beginning).refusal is Refusal.NOT_READY
            assert cell.phase is State.IDLE

    asyncio.run(scenario())


def test_the_station_answers_while_the_disk_takes_a_chosen_recipe(bench, monkeypatch):
    storing, stored = threading.Event(), threading.Event()

    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            book = cell.station.recipes
            store_active = book.store_active

            def slow(*of):
                storing.set()
                assert stored.wait(5)
                return store_active(*of)

            monkeypatch.setattr(book, "store_active", slow)
            changing = asyncio.create_task(cell.line.order(CommandName.CHANGE_RECIPE, NUMBERS["raspberry"]))
            assert await asyncio.to_thread(storing.wait, 60)
            state = await cell.line.state()
            stored.set()
            return state, await changing

    state, changed = asyncio.run(scenario())
    assert state.why_not_ready == readiness.RECIPE_CHANGING()
    assert changed.done, changed.why


def test_the_last_recipe_is_what_the_file_has_also_where_the_disk_outlasts_the_lots_begin(bench, monkeypatch):
    storing, stored = threading.Event(), threading.Event()

    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            book, service = cell.station.recipes, cell.station.service
            store_active = book.store_active

            def slow_once(*of):
                if not storing.is_set():
                    storing.set()
                    assert stored.wait(60)
                return store_active(*of)

            monkeypatch.setattr(book, "store_active", slow_once)
            beginning = asyncio.create_task(begin(cell, 900, "LOT 2"))
            assert await asyncio.to_thread(storing.wait, 60)
            changing = asyncio.create_task(cell.line.order(CommandName.CHANGE_RECIPE, NUMBERS["raspberry"]))
            await cell.until(lambda: service.active.snapshot.name == "raspberry")
            stored.set()
            await beginning
            return await changing, book.restored()

    changed, restored = asyncio.run(scenario())
    assert changed.done, changed.why
    assert restored.active.snapshot.name == "raspberry"


def test_a_trigger_whose_answer_is_not_waited_for_any_more_begins_nothing(bench, monkeypatch):
    """The PLC received that it is refused, and may move the fruit."""
    storing, stored = threading.Event(), threading.Event()

    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            recipes = cell.station.recipes
            store_active = recipes.store_active

            def slow(*of):
                storing.set()
                assert stored.wait(60)
                return store_active(*of)

            monkeypatch.setattr(recipes, "store_active", slow)
            given_up = asyncio.create_task(begin(cell, 900, "LOT 2", deadline_s=3))
            assert await asyncio.to_thread(storing.wait, 60)
            with pytest.raises(DeadlineError):
                await given_up
            following = asyncio.create_task(begin(cell, 901, "LOT 2"))
            stored.set()
            reply = await following
            assert reply.refusal is None
            assert (await cell.line.outcome(reply.sequence)).trigger_id == 901
            assert [each.trigger_id for each in (await cell.line.open()).outcomes] == [901]

    asyncio.run(scenario())


def test_a_trigger_that_is_durable_after_its_answer_was_waited_for_is_called_off(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            records, free = cell.station.service.registry.records, asyncio.Event()
            store = records.begin

            async def slow(trigger):
                sequence = await store(trigger)
                await free.wait()
                return sequence

            monkeypatch.setattr(records, "begin", slow)
            with pytest.raises(DeadlineError):
                await begin(cell, 900, "LOT 2", deadline_s=3)
            free.set()
            await cell.line.ready()
            return (await cell.line.open()).outcomes

    (outcome,) = asyncio.run(scenario())
    assert (outcome.trigger_id, outcome.outcome, outcome.reasons[0]) == (900, "NO_RESULT", Reason.CALLED_OFF)


async def begin(cell, trigger_id, lot, deadline_s=20.0):
    await cell.line.ready()
    request = Begin(trigger_id=trigger_id, encoder=7, lot=lot)
    return await cell.line.client.request(request, BeginReply, deadline_s=deadline_s)


@pytest.fixture
def slow_start(monkeypatch):
    """Have the records wait in the registration of each lot, once it is called: (it waits, it may go on)."""
    starting, may_start = threading.Event(), threading.Event()
    start_lot = operator_commands.start_lot

    def slow(*of):
        starting.set()
        assert may_start.wait(60)
        return start_lot(*of)

    def begin():
        monkeypatch.setattr(operator_commands, "start_lot", slow)
        return starting, may_start

    return begin


def test_the_end_of_a_lot_leaves_one_that_was_started_while_the_disk_was_slow(bench, slow_start):
    starting, may_start = slow_start()

    async def scenario():
        async with bench() as cell:
            assert (await give(cell, OperatorCommandName.START_LOT, "A")).state == "done"
            started = asyncio.create_task(give(cell, OperatorCommandName.START_LOT, "B", "Meier"))
            assert await asyncio.to_thread(starting.wait, 60)
            ended = asyncio.create_task(give(cell, OperatorCommandName.END_LOT, "A"))
            async with asyncio.timeout(60):
                while not [each for each in (await panel_state(cell)).orders if each.order == "end_lot"]:
                    await asyncio.sleep(0.02)
            may_start.set()
            assert [(await each).state for each in (started, ended)] == ["done", "done"]
            return (await panel_state(cell)).named_lot

    assert asyncio.run(scenario()) == "B"


def test_of_two_lots_that_are_started_at_once_the_last_one_runs(bench, slow_start):
    async def scenario():
        async with bench() as cell:
            assert (await give(cell, OperatorCommandName.START_LOT, "A", "Meier")).state == "done"
            starting, may_start = slow_start()
            first = asyncio.create_task(give(cell, OperatorCommandName.START_LOT, "B", "Meier"))
            assert await asyncio.to_thread(starting.wait, 60)
            second = asyncio.create_task(give(cell, OperatorCommandName.START_LOT, "C", "Meier"))
            async with asyncio.timeout(60):
                while "C" not in {each.argument for each in (await panel_state(cell)).orders}:
                    await asyncio.sleep(0.02)
            may_start.set()
            assert [(await each).state for each in (first, second)] == ["done", "done"]
            lots = await cell.station.service.registry.records.change(lambda connection: read_lots(connection, 9))
            return (await panel_state(cell)).named_lot, {lot.name for lot in lots if not lot.ended_utc_ms}

    assert asyncio.run(scenario()) == ("C", {"C"})


def test_a_lot_in_place_of_which_another_is_started_has_ended_and_runs_when_it_is_started_again(bench):
    async def scenario():
        async with bench() as cell:
            records = cell.station.service.registry.records

            async def running():
                return {lot.name for lot in await records.change(lambda it: read_lots(it, 9)) if not lot.ended_utc_ms}

            assert (await give(cell, OperatorCommandName.START_LOT, "A", "Meier")).state == "done"
            assert (await give(cell, OperatorCommandName.START_LOT, "B", "Huber")).state == "done"
            assert await running() == {"B"}
            assert (await give(cell, OperatorCommandName.START_LOT, "A")).state == "done", "its grower is known"
            assert await running() == {"A"}
            assert (await give(cell, OperatorCommandName.END_LOT, "A")).state == "done"
            assert await running() == set()
            return records_folder(cell.configuration.home)

    with reading(asyncio.run(scenario())) as connection:
        rows = [row for row in read_audit(connection, 100, "lot.") if row.who == "Ida"]
    assert [(row.action, row.subject, row.new) for row in rows] == [
        ("lot.told", "lot A", '{"grower":"Meier"}'),
        ("lot.ended", "lot A", None),
        ("lot.told", "lot B", '{"grower":"Huber"}'),
        ("lot.ended", "lot B", None),
        ("lot.told", "lot A", '{"grower":"Meier"}'),
        ("lot.ended", "lot A", None),
    ]


def test_a_lot_whose_end_the_records_refuse_is_not_ended(bench, monkeypatch):
    full = DiskFullError(records_messages.DISK_FULL(place="records", words="ENOSPC"), records_messages.FREE_SPACE())

    def refuse(*_):
        raise full

    async def scenario():
        async with bench() as cell:
            assert (await give(cell, OperatorCommandName.START_LOT, "A", "Meier")).state == "done"
            monkeypatch.setattr(operator_commands, "end_lot", refuse)
            for order, lot in ((OperatorCommandName.END_LOT, "A"), (OperatorCommandName.START_LOT, "B")):
                refused = await give(cell, order, lot)
                assert (refused.state, refused.why) == ("failed", message_of(full))
            assert (await panel_state(cell)).named_lot == "A"

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_lot_started_at_the_panel_continues_over_a_restart_with_its_revision_and_an_ended_one_does_not(
    bench, settings_file
):
    file = settings_file()

    async def scenario():
        async with bench(file) as cell:
            await cell.choose("blueberry")
            assert (await give(cell, OperatorCommandName.START_LOT, "A")).state == "done"
            home, folder = cell.configuration.home, cell.configuration.recipes_folder
            assert (home / "named_lot").read_text() == "A", "a kill from now on loses nothing"
            fruit = [await inspected(cell, 900)]
            editor, store = RecipeEditor(home, folder), RecipeStore(home, folder)
            await asyncio.to_thread(editor.edit, "blueberry", {"damage.growth_mm2_per_mm": 55.0}, IDA)
            await asyncio.to_thread(store.submit, "blueberry", IDA)
            await asyncio.to_thread(store.approve, "blueberry", BO)
        async with bench(file) as cell:
            await cleared(cell, "blueberry")
            assert (await panel_state(cell)).named_lot == "A"
            fruit.append(await inspected(cell, 901))
            assert (await give(cell, OperatorCommandName.END_LOT, "A")).state == "done"
        async with bench(file) as cell:
            await cleared(cell, "blueberry")
            state = await panel_state(cell)
            assert (state.named_lot, state.lot) == ("", None)
            fruit.append(await inspected(cell, 902))
        return [(each.lot, each.recipe.revision) for each in fruit]

    assert asyncio.run(scenario()) == [("A", "1"), ("A", "1"), ("", "2")]


def test_the_counts_are_those_of_the_lot_that_was_started_also_before_its_first_fruit(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await inspected(cell, 900)
            before = (await panel_state(cell)).lot_counts
            assert (await give(cell, OperatorCommandName.START_LOT, "A")).state == "done"
            return before, (await panel_state(cell)).lot_counts

    before, after = asyncio.run(scenario())
    assert before.passed + before.failed + before.unjudged == 1
    assert after == Counts()


def test_a_lot_that_cannot_be_stored_is_started_or_ended_and_said(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            monkeypatch.setattr(StateFiles, "write", lambda *_: False)
            started = await give(cell, OperatorCommandName.START_LOT, "A")
            assert (started.state, started.why) == ("failed", lots.START_NOT_STORED(lot="A"))
            assert (await panel_state(cell)).named_lot == "A"
            ended = await give(cell, OperatorCommandName.END_LOT, "A")
            assert (ended.state, ended.why) == ("failed", lots.END_NOT_STORED(lot="A"))
            assert (await panel_state(cell)).named_lot == ""

    asyncio.run(scenario())


def test_the_last_lot_is_what_the_file_has_also_where_the_disk_outlasts_the_order_before(tmp_path, monkeypatch):
    started, free, write = threading.Event(), threading.Event(), StateFiles.write

    def slow_once(self, name, data):
        if not started.is_set():
            started.set()
            assert free.wait(60)
        return write(self, name, data)

    monkeypatch.setattr(StateFiles, "write", slow_once)

    async def scenario():
        manager = lot_manager(tmp_path)
        first = asyncio.create_task(manager.set_lot("A"))
        assert await asyncio.to_thread(started.wait, 60)
        first.cancel()
        await asyncio.gather(first, return_exceptions=True)
        second = asyncio.create_task(manager.set_lot("B"))
        await asyncio.wait({second}, timeout=0.3)  # one that did not wait for the first would be overtaken by it
        free.set()
        return await second

    assert asyncio.run(scenario())
    assert (tmp_path / "named_lot").read_bytes() == b"B"


@pytest.mark.parametrize(
    ("stored", "named"), [(b"A-17", "A-17"), (b"", ""), (b"\xff\xfe", ""), (b"A\n", ""), (b" ", ""), (33 * b"A", "")]
)
def test_a_file_without_a_lots_name_keeps_no_station_from_starting(tmp_path, stored, named):
    (tmp_path / "named_lot").write_bytes(stored)
    manager = lot_manager(tmp_path)
    manager.restore()
    assert manager.named == named


def lot_manager(home):
    """A lot manager of a station without a recipe."""
    service: Any = SimpleNamespace(active=None)
    nothing: Any = SimpleNamespace(restored=lambda: None)
    return LotManager(service, nothing, nothing, StateFiles(home))


async def cleared(cell, kind):
    """Confirm after a start, as a person does on a bench, that the jaws are clear; the recipe is that of before."""
    cell.twin.world.remove()
    await cell.until(lambda: cell.phase in {State.UNKNOWN, State.HELD, State.IDLE})
    done = await cell.line.order(CommandName.RESET)
    assert done.done, done.why
    cell.lay(kind)


async def inspected(cell, trigger_id):
    """One fruit for which the PLC names no lot; its trigger as the records have it."""
    reply = await begin(cell, trigger_id, "")
    assert reply.refusal is None, await cell.line.state()
    await cell.line.publish(await cell.line.outcome(reply.sequence))
    return read_record(cell.station.service.registry.records, reply.sequence).trigger


async def at_panel(cell, request, reply):
    configuration = cell.configuration
    async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:
        return await panel.request(request, reply, deadline_s=20)


async def panel_state(cell):
    return await at_panel(cell, GetPanelState(), PanelState)


async def give(cell, order, lot, grower=""):
    """Give an order at the panel, and return it once it has ended."""
    request = OperatorCommand(person=Actor(who="Ida", role="operator"), order=order, argument=lot, grower=grower)
    given = await at_panel(cell, request, OperatorCommandView)
    async with asyncio.timeout(60):
        while given.state == "executing":
            await asyncio.sleep(0.02)
            given = next(each for each in (await panel_state(cell)).orders if each.ticket == given.ticket)
    return given
