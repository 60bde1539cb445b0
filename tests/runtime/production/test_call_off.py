"""A fruit that is aborted at the panel: that one, and no later one."""

import asyncio

import pytest

from station.channel.client import ChannelClient
from station.channel.panel import Actor
from station.channel.panel_live import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.inspection.states import State
from station.messages import commands
from station.settings.hmi import panel_endpoint
from station.vocabulary import Reason


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
