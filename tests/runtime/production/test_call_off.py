"""A fruit that is aborted by the PLC or at the panel: that one at once, and no later one."""

import asyncio

import pytest

from station.channel.client import ChannelClient
from station.channel.line import CommandName
from station.channel.panel import Actor
from station.channel.panel_run import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.inspection.cycle import Action
from station.inspection.states import State
from station.messages import commands
from station.runtime.production.plc_commands import PlcCommands
from station.settings.hmi import panel_endpoint
from station.vocabulary import Reason
from tests.quick_recipes import NUMBERS


@pytest.mark.timeout(240)
def test_a_button_that_was_pressed_for_the_fruit_before_aborts_none(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("strawberry")
            await cell.line.ready()
            configuration = cell.configuration
            async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:

                async def call_off(argument):
                    request = OperatorCommand(
                        person=Actor(who="Ada", role="operator"),
                        order=OperatorCommandName.CALL_OFF,
                        argument=argument,
                    )
                    return await panel.request(request, OperatorCommandView, deadline_s=20)

                idle = await panel.request(GetPanelState(), PanelState, deadline_s=20)
                inspected = asyncio.create_task(cell.line.inspect())
                await cell.reach(State.CLOSING_TO_ONSET)
                state = await panel.request(GetPanelState(), PanelState, deadline_s=20)
                assert state.running_sequence is not None
                late = await call_off(str(state.running_sequence - 1))
                meant = await call_off(str(state.running_sequence))
                return idle, state, late, meant, await inspected

    idle, state, late, meant, outcome = asyncio.run(scenario())
    assert (idle.running_sequence, state.running_sequence) == (None, outcome.sequence)
    assert late.why == commands.ANOTHER_FRUIT(sequence=str(outcome.sequence - 1))
    assert (late.state, meant.state) == ("failed", "done")
    assert outcome.reasons[0] is Reason.CALLED_OFF


@pytest.mark.timeout(240)
def test_a_call_off_does_not_wait_for_a_change_of_recipe_that_waits_for_the_fruit(bench, monkeypatch):
    made, restore = [], PlcCommands.restore
    monkeypatch.setattr(PlcCommands, "restore", lambda self: made.append(self) or restore(self))

    async def scenario():
        async with bench() as cell:
            await cell.choose("strawberry")
            inspected = asyncio.create_task(cell.line.inspect())
            await cell.reach(State.CLOSING_TO_ONSET)
            changing = asyncio.create_task(cell.line.order(CommandName.CHANGE_RECIPE, NUMBERS["blueberry"]))
            while not made[0].recipe_changing:
                await asyncio.sleep(0)
            called_off = await cell.line.order(CommandName.CALL_OFF)
            return called_off, await inspected, await changing, await cell.line.state()

    called_off, outcome, changed, state = asyncio.run(scenario())
    assert called_off.done, called_off.why
    assert outcome.reasons[0] is Reason.CALLED_OFF
    assert changed.done, changed.why
    assert state.recipe_number == NUMBERS["blueberry"]


@pytest.mark.timeout(240)
def test_a_call_off_that_comes_with_the_judgement_is_not_done(bench, monkeypatch):
    held_back = []

    async def scenario():
        async with bench() as cell:
            await cell.choose("strawberry")
            service, judged = cell.station.service, asyncio.Event()
            runner, actions = service.runner, service._of_inspection

            async def held(now):
                event = await actions[Action.JUDGE](now)
                await judged.wait()
                held_back.append(event)
                return event

            service._of_inspection = {**actions, Action.JUDGE: held}
            inspected = asyncio.create_task(cell.line.inspect())
            await cell.reach(State.JUDGING)
            # The judgement's event is taken before the other, which then changes nothing.
            monkeypatch.setattr(runner, "post", lambda *_: judged.set())
            return await cell.line.order(CommandName.CALL_OFF), await inspected

    done, outcome = asyncio.run(scenario())
    assert len(held_back) == 1
    assert (done.done, done.why) == (False, commands.JUDGED())
    assert Reason.CALLED_OFF not in outcome.reasons
