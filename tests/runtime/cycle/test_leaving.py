"""Triggers while the arm leaves the fruit before: accepted at once, started when it has left, each with one outcome."""

import asyncio
import json

import pytest

from station.channel.client import ChannelClient
from station.channel.line import CommandName
from station.channel.panel import Actor
from station.channel.panel_run import OperatorCommand, OperatorCommandName, OperatorCommandView
from station.inspection.states import State
from station.settings.gripper import GripperCalibration
from station.settings.hmi import panel_endpoint
from station.twin.fruit import Kind, draw_fruit
from station.vocabulary import Reason, Refusal
from tests.stored_inspection import read_record


async def ready_with_arm(cell):
    """A cell with its arm at rest, and a sound blueberry in the nest."""
    assert (await cell.line.order(CommandName.CHANGE_RECIPE, 2)).done
    # The arm's program is uploaded, and the gripper activated.
    await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
    cell.lay("blueberry", 1)


async def inspected_until_leaving(cell):
    """One fruit, up to where the arm leaves it, ten times as slowly as usual."""
    cell.at(State.RETREATING_READY, lambda: cell.twin.boards["arm"].set("slow", 9.0))
    outcome = await cell.line.inspect()
    await cell.line.ready()
    assert cell.phase is State.RETREATING_READY
    return outcome


@pytest.mark.timeout(240)
def test_a_trigger_is_accepted_while_the_arm_leaves_and_a_fault_then_gives_it_one_no_result(bench):
    async def scenario():
        async with bench(bench=False) as cell:
            line = cell.line
            await ready_with_arm(cell)

            first = await inspected_until_leaving(cell)
            reply = await line.begin()
            assert reply.refusal is None
            cell.twin.boards["arm"].clear()
            second = await line.outcome(reply.sequence)
            await line.publish(second)
            assert (first.outcome, second.outcome) == ("PASS", "PASS")
            assert second.sequence == first.sequence + 1
            record = read_record(cell.station.service.registry.records, second.sequence)
            assert {"retreating_accepted", "approaching"} <= set(record.judged.phases_s)

            await inspected_until_leaving(cell)
            cell.at(State.RETREATING_ACCEPTED, lambda: cell.twin.boards["gripper"].set("off"))
            reply = await line.begin()
            lost = await line.outcome(reply.sequence)
            await line.publish(lost)
            assert (lost.outcome, lost.reasons[0]) == ("NO_RESULT", Reason.GRIPPER_FAULT)
            cell.twin.boards["arm"].clear()
            cell.twin.boards["gripper"].clear()
            await line.ready()
            assert (await line.inspect()).sequence == lost.sequence + 1

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_a_stop_while_the_arm_leaves_lets_no_trigger_in(bench):
    async def scenario():
        async with bench(bench=False) as cell:
            await ready_with_arm(cell)
            await inspected_until_leaving(cell)
            cell.station.service.stop()
            cell.twin.boards["arm"].clear()
            refused = await cell.line.begin()
            assert refused.refusal is Refusal.NOT_READY
            await cell.reach(State.STOPPED)

    asyncio.run(scenario())


@pytest.mark.timeout(240)
def test_each_stop_of_a_person_is_carried_out_also_after_a_start_while_the_arm_leaves(bench):
    """The first *Stop* is under way until the arm has left, and the *Start* in between has lifted it."""
    stored = []

    async def scenario():
        async with bench(bench=False) as cell:
            service, configuration = cell.station.service, cell.configuration
            await ready_with_arm(cell)
            await inspected_until_leaving(cell)
            async with ChannelClient(panel_endpoint(configuration.hmi, configuration.home), "the station") as panel:
                for order, stopped in (("stop", True), ("start", False), ("stop", True)):
                    person = Actor(who="Ada", role="operator")
                    request = OperatorCommand(person=person, order=OperatorCommandName(order))
                    await panel.request(request, OperatorCommandView, deadline_s=20)
                    assert service.stopped_by_person is stopped
                    assert cell.phase is State.RETREATING_READY or order != "start"
            cell.twin.boards["arm"].clear()
            await cell.reach(State.STOPPED)
            stored.append((configuration.home / "stopped_by_a_person").read_bytes())

    asyncio.run(scenario())
    assert stored == [b"yes"]


def test_jaws_that_leave_are_wider_than_a_fruit_that_the_recipe_does_not_expect(bench, settings_file, tmp_path):
    fruit = draw_fruit(Kind.BLUEBERRY, 1)

    async def scenario():
        file, recipe = settings_file(), tmp_path / "recipes" / "blueberry.yaml"
        values = json.loads(recipe.read_text())
        values["expected_width"]["largest_mm"] = round(fruit.width_mm - 1.0, 1)
        recipe.write_text(json.dumps(values))
        async with bench(file) as cell:
            await cell.choose("blueberry")
            gaps_mm = []
            taken_mm = GripperCalibration().finger_offset_mm
            cell.at(State.RETREATING_READY, lambda: gaps_mm.append(cell.twin.world.opening_mm() - taken_mm))
            outcome = await cell.line.inspect()
            await cell.line.ready()
            return outcome, gaps_mm, cell.configuration.arm.jaw_clearance_mm

    outcome, [gap_mm], clearance_mm = asyncio.run(scenario())
    assert Reason.OUT_OF_RANGE in outcome.reasons
    assert gap_mm > fruit.width_mm + clearance_mm - 0.75, "two counts of the gripper"
