"""The station as a process of its own on a whole simulated cell: killed, ended, stopped by arm or person."""

import asyncio
import contextlib
import json
import signal
import subprocess
import sys
import time

import pytest

from plc_interface.client import StationClient
from plc_interface.registers.map import BY_NAME
from station.channel.client import ChannelClient
from station.channel.line import CommandName, PackmlState
from station.channel.panel import Actor
from station.channel.panel_run import (
    GetPanelState,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
)
from station.messages import commands, readiness, states
from station.settings.configuration import load_configuration
from station.settings.hmi import panel_endpoint
from station.settings.plc import line_endpoint
from station.twin.console import ask
from station.vocabulary import Reason
from tests.ports import free_port


@pytest.fixture
def cell(settings_file, line_client):
    """A twin with an arm; starts and ends the station's processes."""
    file = settings_file(bench=False, placing="arm")

    class Cell:
        def __init__(self):
            self.twin = self.start("twin", "--fruit", "blueberry", "--console", "0")
            lines = self.twin.stdout or ()
            self.console = next(int(line.split(":")[1]) for line in lines if line.startswith("console"))
            self.started, self.file = [self.twin], file

        def start(self, *arguments):
            command = [sys.executable, "-m", "station", *arguments, "--config", str(file)]
            return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

        def service(self):
            process = self.start("service", "--log", "json")
            self.started.append(process)
            assert process.stdout is not None
            assert process.stderr is not None
            assert any(line.startswith("running") for line in process.stdout), process.stderr.read()
            return process

        def twin_is(self, **request):
            return ask("127.0.0.1", self.console, request)

        def recover(self, what):
            with self.start("devices", "recover", what, "--yes") as process:
                process.communicate(timeout=60)
                return process.returncode

        @contextlib.asynccontextmanager
        async def line(self):
            configuration = load_configuration(file, {})
            async with ChannelClient(line_endpoint(configuration.handshake, configuration.home), "the station") as c:
                yield line_client(c)

    made = Cell()
    yield made
    for process in reversed(made.started):
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)


async def aborted(line):
    """A stop is latched: at once, or with the next check of an arm that reported only a failed move first."""
    deadline_s = time.monotonic() + 30
    while True:
        state = await line.state()
        assert not state.ready, "with any report of the arm so far"
        if (state.packml_state, state.error_code) == (PackmlState.ABORTED, 2):
            return
        assert time.monotonic() < deadline_s, state
        await asyncio.sleep(0.02)


@pytest.mark.timeout(240)
def test_a_killed_a_stopped_and_an_ended_station_lose_and_double_nothing(cell):
    first = cell.service()

    async def until_killed():
        async with cell.line() as line:
            assert (await line.order(CommandName.CHANGE_RECIPE, 2)).done
            await line.ready()
            reply = await line.begin()
            assert (await line.state()).packml_state in {PackmlState.STARTING, PackmlState.EXECUTE}
            first.kill()
            first.wait()
            return reply

    reply = asyncio.run(until_killed())
    second = cell.service()

    async def until_ended():
        async with cell.line() as line:
            ready = await line.ready()
            assert ready.recipe_number == 2, "the recipe chosen last is active again"
            held = await line.open()
            assert held.running is None
            [lost] = held.outcomes
            assert (lost.sequence, lost.outcome, lost.reasons) == (reply.sequence, "NO_RESULT", (Reason.STATION_LOST,))
            assert await line.outcome(reply.sequence) == lost
            await line.publish(lost)
            assert (await line.open()).outcomes == ()

            stopped = await line.begin()
            assert stopped.sequence == reply.sequence + 1
            for do in ("set", "clear"):
                cell.twin_is(do=do, device="arm", fault="protective_stop", amount=1.0)
            outcome = await line.outcome(stopped.sequence)
            assert (outcome.outcome, outcome.reasons[0]) == ("NO_RESULT", Reason.ARM_FAULT)
            await line.publish(outcome)
            await aborted(line)
            refused = await line.order(CommandName.RESET)
            assert not refused.done
            assert refused.why.id == commands.CONFIRM_STOP.id
            assert await asyncio.to_thread(cell.recover, "protective-stop") == 0
            assert not (await line.state()).ready, "only a reset lets the station go on"
            done = await line.order(CommandName.RESET)
            assert done.done, done.why
            await line.ready()

            called_off = await line.begin()
            waiting = asyncio.create_task(line.outcome(called_off.sequence))
            await asyncio.sleep(0)
            second.send_signal(signal.SIGTERM)
            second.send_signal(signal.SIGTERM)
            return await waiting

    outcome = asyncio.run(until_ended())
    assert (outcome.outcome, outcome.reasons[0]) == ("NO_RESULT", Reason.CALLED_OFF)
    _, log = second.communicate(timeout=60)
    assert second.returncode == 0, log
    assert "Traceback" not in log


async def at_the_panel(file, request, reply):
    configuration = load_configuration(file, {})
    async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:
        return await panel.request(request, reply, deadline_s=20)


async def is_done(file, ticket):
    """A command that is carried out for longer than the panel waits for its end is done all the same."""
    async with asyncio.timeout(60):
        while True:
            [now] = [
                each for each in (await at_the_panel(file, GetPanelState(), PanelState)).orders if each.ticket == ticket
            ]
            if now.state != "executing":
                break
            await asyncio.sleep(0.05)
    assert now.state == "done", now.why


def order(name, argument=""):
    return OperatorCommand(person=Actor(who="Olga", role="operator"), order=name, argument=argument)


@pytest.mark.timeout(400)
def test_what_only_a_person_may_end_outlives_kills_and_nothing_moves_meanwhile(cell):
    """A fruit that the arm carries, a safety stop confirmed while the station is away, stops on pendant and panel."""

    async def kill_while_carrying(service):
        async with cell.line() as line:
            assert (await line.order(CommandName.CHANGE_RECIPE, 2)).done
            await line.ready()
            reply = await line.begin()
            cell.twin_is(do="set", device="arm", fault="slow", amount=4.0)
            outcome = await line.outcome(reply.sequence)
            service.kill()
            service.wait()
            cell.twin_is(do="clear", device="arm", fault="slow")
            return outcome

    async def is_held(packml, why):
        """The same state for a while, in which neither arm nor jaws move; then it may be killed again."""
        async with cell.line() as line:
            async with asyncio.timeout(60):
                while (await line.state()).packml_state is not packml:
                    await asyncio.sleep(0.05)
            before = cell.twin_is(do="state")
            await asyncio.sleep(2.0)
            state, after = await line.state(), cell.twin_is(do="state")
            assert (state.packml_state, state.why_not_ready) == (packml, why)
            assert before["arm_rad"] == pytest.approx(after["arm_rad"], abs=1e-4)
            assert before["width_mm"] == pytest.approx(after["width_mm"], abs=0.01)
            return after

    async def reset(publish=None):
        async with cell.line() as line:
            if publish is not None:
                await line.publish(publish)
            done = await line.order(CommandName.RESET)
            assert done.done, done.why
            await line.ready()

    async def ready():
        async with cell.line() as line:
            await line.ready()

    outcome = asyncio.run(kill_while_carrying(cell.service()))
    for _ in range(2):
        service = cell.service()
        held = asyncio.run(is_held(PackmlState.HELD, states.CARRIED()))
        assert held["width_mm"] < 40, "the fruit is between the jaws"
        service.kill()
        service.wait()
    service = cell.service()
    cell.twin_is(do="remove")
    asyncio.run(reset(outcome))

    cell.twin_is(do="set", device="arm", fault="protective_stop", amount=1.0)
    asyncio.run(is_held(PackmlState.ABORTED, states.LATCHED()))
    service.kill()
    service.wait()
    cell.twin_is(do="clear", device="arm", fault="protective_stop")
    assert cell.recover("protective-stop") == 0
    service = cell.service()
    asyncio.run(is_held(PackmlState.ABORTED, states.LATCHED()))
    asyncio.run(reset())

    cell.twin_is(do="set", device="arm", fault="pendant_stop", amount=1.0)
    asyncio.run(is_held(PackmlState.ABORTED, states.LATCHED()))
    service.kill()
    service.wait()
    cell.twin_is(do="clear", device="arm", fault="pendant_stop")
    service = cell.service()
    asyncio.run(is_held(PackmlState.ABORTED, states.LATCHED()))
    asyncio.run(reset())

    view = asyncio.run(at_the_panel(cell.file, order(OperatorCommandName.STOP), OperatorCommandView))
    asyncio.run(is_done(cell.file, view.ticket))
    service.kill()
    service.wait()
    service = cell.service()
    asyncio.run(is_held(PackmlState.STOPPED, readiness.STOPPED_BY_PERSON()))
    started = asyncio.run(at_the_panel(cell.file, order(OperatorCommandName.START), OperatorCommandView))
    assert started.state != "failed", started.why
    asyncio.run(ready())


@pytest.mark.timeout(240)
def test_after_an_emergency_stop_a_person_is_offered_only_what_can_work(cell):
    """Nothing while the button is pressed, then the power, and *Start* only when the arm has it."""
    cell.service()

    async def offered(recoveries, *, start):
        """Wait until the panel offers this."""
        async with asyncio.timeout(60):
            while True:
                state = await at_the_panel(cell.file, GetPanelState(), PanelState)
                found = state.recoveries, OperatorCommandName.START in state.may
                if found == (recoveries, start) and state.packml_state is PackmlState.ABORTED:
                    return
                assert found[1] <= start or state.packml_state is not PackmlState.ABORTED, "never too early"
                await asyncio.sleep(0.05)

    async def scenario():
        async with cell.line() as line:
            assert (await line.order(CommandName.CHANGE_RECIPE, 2)).done
            await line.ready()
            cell.twin_is(do="set", device="arm", fault="emergency_stop", amount=1.0)
            await offered((), start=False)
            cell.twin_is(do="clear", device="arm", fault="emergency_stop")
            await offered(("power",), start=False)
            refused = await line.order(CommandName.RESET)
            assert (refused.done, refused.why.id) == (False, commands.CONFIRM_STOP.id)
            powered = await at_the_panel(cell.file, order(OperatorCommandName.RECOVER, "power"), OperatorCommandView)
            assert powered.state != "failed", powered.why
            await offered((), start=True)
            started = await line.order(CommandName.RESET)
            assert started.done, started.why
            await line.ready()

    asyncio.run(scenario())


@pytest.mark.timeout(300)
def test_the_plc_reads_the_outcome_of_the_inspection_that_the_end_of_the_station_has_ended(cell):
    port = free_port()
    patient = {"begin_deadline_s": 2.5, "station_lost_after_s": 30.0, "plc_heartbeat_timeout_s": 30.0}
    values = json.loads(cell.file.read_text())
    values |= {"modbus": {"port": port}, "hmi": {"port": free_port()}, "handshake": patient}
    cell.file.write_text(json.dumps(values))
    station = cell.start("run")
    cell.started.append(station)
    assert station.stdout is not None
    assert station.stderr is not None
    assert any(line.startswith("running; Ctrl-C") for line in station.stdout), station.stderr.read()

    async def scenario():
        async with StationClient("127.0.0.1", port, timeout_s=10) as plc:
            await plc.arm()
            await plc.change_recipe(2)
            async with asyncio.timeout(90):
                while "trigger_ready" not in await plc.status():
                    await asyncio.sleep(0.02)
            inspecting = asyncio.create_task(plc.inspect(1, deadline_s=90.0))
            execute = BY_NAME["packml_state"].code("execute")
            async with asyncio.timeout(60):
                while await plc.read("packml_state") != execute:
                    await asyncio.sleep(0.01)
            # Else it may end by itself before the signal is handled.
            cell.twin_is(do="set", device="arm", fault="slow", amount=9.0)
            station.send_signal(signal.SIGTERM)
            return await inspecting

    result = asyncio.run(scenario())
    assert (result.trigger_id, result.outcome) == (1, "NO_RESULT")
    assert "called_off" in result.reasons
    _, log = station.communicate(timeout=120)
    assert station.returncode == 0, log
