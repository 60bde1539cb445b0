"""A lot keeps the recipe that it began with, whatever people do to the recipes meanwhile; all of it is in the trail."""

import asyncio
import threading

import pytest

from station.channel.client import ChannelClient
from station.channel.line import Begin, BeginReply, CommandName
from station.channel.messages import DeadlineError
from station.channel.panel import Actor
from station.channel.panel_live import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.inspection.states import State
from station.messages import lots, readiness, recipes
from station.recipe_store.editor import RecipeEditor
from station.recipe_store.history import Person
from station.recipe_store.store import RecipeStore
from station.records.audit_check import check_audit
from station.records.audit_head import read_head
from station.records.audit_report import read_audit
from station.records.database import reading, records_folder
from station.runtime.production import operator_commands
from station.settings.hmi import panel_endpoint
from station.vocabulary import Reason, Refusal
from tests.quick_recipes import NUMBERS

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

            begun = await begin(cell, 900, "LOT 2")
            assert begun.refusal is None
            second = await cell.line.outcome(begun.sequence)
            await cell.line.publish(second)
            assert second.recipe_checksum != first.recipe_checksum
            record = await cell.station.service.registry.records.inspection(second.sequence)
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
    """The PLC was told that it is refused, and may move the fruit."""
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
            begun = await following
            assert begun.refusal is None
            assert (await cell.line.outcome(begun.sequence)).trigger_id == 901
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


def test_the_end_of_a_lot_leaves_one_that_was_started_while_the_disk_was_slow(bench, monkeypatch):
    ending, may_end = threading.Event(), threading.Event()
    end_lot = operator_commands.end_lot

    def slow(*of):
        ending.set()
        assert may_end.wait(60)
        return end_lot(*of)

    monkeypatch.setattr(operator_commands, "end_lot", slow)

    async def scenario():
        async with bench() as cell:
            configuration = cell.configuration
            async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:

                async def give(who, order, lot):
                    request = OperatorCommand(person=Actor(who=who, role="operator"), order=order, argument=lot)
                    return await panel.request(request, OperatorCommandView, deadline_s=20)

                async def state():
                    return await panel.request(GetPanelState(), PanelState, deadline_s=20)

                assert (await give("Ida", OperatorCommandName.START_LOT, "A")).state == "done"
                given = asyncio.create_task(give("Ida", OperatorCommandName.END_LOT, "A"))
                assert await asyncio.to_thread(ending.wait, 60)
                assert (await give("Bo", OperatorCommandName.START_LOT, "B")).state == "done"
                may_end.set()
                ticket = (await given).ticket
                async with asyncio.timeout(60):
                    while next(each for each in (await state()).orders if each.ticket == ticket).state != "done":
                        await asyncio.sleep(0.02)
                return (await state()).named_lot

    assert asyncio.run(scenario()) == "B"
