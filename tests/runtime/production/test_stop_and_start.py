"""A person's *Stop* and *Start*, in any order: the last one counts."""

import asyncio

import pytest

from station.channel.client import ChannelClient
from station.channel.line import Command, CommandName, PackmlState
from station.channel.panel import Actor
from station.channel.panel_run import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.devices.gripper.errors import GripperUnreachableError
from station.inspection.states import State
from station.messages import commands, readiness
from station.runtime.production.plc_commands import PlcCommands
from station.settings.hmi import panel_endpoint
from tests.runtime.ball import give, stop


@pytest.mark.timeout(240)
def test_a_start_after_a_stop_is_no_second_press_of_the_start_before_it(bench):
    """The first *Start* waits for the gripper; the *Stop* ends it, and the *Start* after that is one of its own."""

    async def scenario():
        async with bench() as cell:
            service, configuration = cell.station.service, cell.configuration
            cell.twin.boards["gripper"].set("off")
            await cell.until(lambda: isinstance(service._devices.faults.get("gripper"), GripperUnreachableError))
            assert cell.phase is State.UNKNOWN
            async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:

                async def give(order):
                    person = Actor(who="Ada", role="operator")
                    request = OperatorCommand(person=person, order=OperatorCommandName(order))
                    return await panel.request(request, OperatorCommandView, deadline_s=20)

                async def outcome(given):
                    state = await panel.request(GetPanelState(), PanelState, deadline_s=20)
                    return next(each for each in state.orders if each.ticket == given.ticket)

                first = await give("start")
                assert first.state == "executing"
                assert (await give("start")).ticket == first.ticket
                await give("stop")
                assert service.stopped_by_person
                again = await give("start")
                assert again.ticket != first.ticket
                assert not service.stopped_by_person
                assert (await outcome(first)).why == commands.STOPPED_MEANWHILE()
                assert again.state == "executing"
                cell.twin.boards["gripper"].clear()
                await cell.reach(State.IDLE)

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_start_right_after_a_stop_starts_a_station_that_the_stop_has_yet_to_reach(bench, monkeypatch):
    made, restore = [], PlcCommands.restore
    monkeypatch.setattr(PlcCommands, "restore", lambda self: made.append(self) or restore(self))

    async def scenario():
        async with bench() as cell:
            await cell.choose("strawberry")
            service, orders = cell.station.service, made[0]
            stopping = asyncio.create_task(orders.stop())
            while not service.stopped_by_person:
                await asyncio.sleep(0)
            started = await orders.execute(Command(command=CommandName.RESET, argument=0), ("Ada", "operator"))
            assert started.done, started.why
            await stopping
            assert cell.phase is State.IDLE

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_persons_stop_is_ended_by_a_person_and_not_by_a_plc_that_resets_by_itself(bench):
    """Also after a restart: the person may have a hand at the gel."""

    async def give(cell, order):
        configuration = cell.configuration
        async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:
            request = OperatorCommand(person=Actor(who="Ada", role="operator"), order=order)
            await panel.request(request, OperatorCommandView, deadline_s=20)

    async def plc_resets(cell):
        done = await cell.line.order(CommandName.RESET)
        assert (done.done, done.why) == (False, readiness.STOPPED_BY_PERSON())
        return await cell.line.state()

    async def scenario():
        async with bench() as cell:
            await cell.choose("strawberry")
            await cell.line.ready()
            await give(cell, OperatorCommandName.STOP)
            await cell.reach(State.STOPPED)
            state = await plc_resets(cell)
            assert (state.packml_state, state.why_not_ready) == (PackmlState.STOPPED, readiness.STOPPED_BY_PERSON())
        async with bench() as cell:
            cell.twin.world.remove()
            await cell.until(lambda: cell.phase in {State.UNKNOWN, State.HELD, State.STOPPED})
            await plc_resets(cell)
            await give(cell, OperatorCommandName.START)
            await cell.reach(State.IDLE)
            assert (await cell.line.order(CommandName.RESET)).done

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_stop_while_a_lost_activation_is_being_restored_keeps_the_fingers_where_they_are(bench):
    async def scenario():
        async with bench(bench=False) as cell:
            await cell.choose("strawberry")
            await cell.line.ready()
            service, configuration = cell.station.service, cell.configuration
            link, resetting, free, activations = (
                service._devices.cell.gripper.link,
                asyncio.Event(),
                asyncio.Event(),
                list[str](),
            )
            reset, begin_activation = link.reset, link.begin_activation

            async def slow_reset():
                resetting.set()
                await free.wait()
                await reset()

            async def noted():
                activations.append(cell.phase)
                await begin_activation()

            link.reset, link.begin_activation = slow_reset, noted
            cell.twin.boards["gripper"].set("power_cut")
            cell.twin.boards["gripper"].clear()
            async with asyncio.timeout(60):
                await resetting.wait()
            async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:
                stopping = asyncio.create_task(stop(panel))
                await cell.until(lambda: service.stopped_by_person)
                free.set()
                await stopping
                assert activations == []
                assert (await give(panel, OperatorCommandName.START)).state == "done"
            assert cell.phase is State.IDLE
            assert activations == [State.HELD], "the start restores it"

    asyncio.run(scenario())
