"""Requests of the PLC interface beside a fruit's outcome: doubled triggers, refusals, commands, the state."""

import asyncio
import json

import pytest

from station.channel.line import CommandName, Outcome, PackmlState
from station.channel.messages import RefusedError
from station.inspection.alarm_table import ALARMS, AlarmId
from station.inspection.deadlines import LONGEST_S, deadlines
from station.inspection.states import State
from station.messages import readiness
from station.messages.recipes import NOT_FOR_INSPECTIONS
from station.runtime.cycle import pacing, service
from station.vocabulary import Reason, Refusal


def test_the_life_of_triggers_and_commands(bench):
    async def scenario():
        async with bench() as cell:
            line = cell.line
            first = await line.state()
            assert not first.ready
            assert first.why_not_ready
            assert (await line.begin(9)).refusal is Refusal.NOT_READY

            await cell.choose("blueberry")
            ready = await line.ready()
            assert ready.packml_state is PackmlState.IDLE
            assert ready.recipe_number == 2
            assert ready.recipe_checksum > 0
            assert ready.simulated

            reply = await line.begin(10)
            doubled, other = await asyncio.gather(line.begin(10), line.begin(11))
            assert [doubled.refusal, other.refusal] == [Refusal.BUSY, Refusal.BUSY]
            assert (await line.open()).running == (reply.sequence, 10)
            changing = asyncio.create_task(line.order(CommandName.CHANGE_RECIPE, 3))
            outcome = await line.outcome(reply.sequence)
            assert outcome.trigger_id == 10
            assert outcome.recipe_number == 2, "the recipe is frozen at the trigger"
            assert outcome.recipe_checksum == ready.recipe_checksum
            assert outcome == await line.outcome(reply.sequence)
            assert [held.sequence for held in (await line.open()).outcomes] == [reply.sequence]
            assert (await changing).done
            assert (await line.ready()).recipe_number == 3

            again = await line.begin(10)
            assert again.sequence == reply.sequence + 1, "the same id is another fruit, its outcome published or not"
            await line.publish(outcome)
            await line.publish(outcome)
            assert (await line.open()).outcomes == ()
            await cell.reach(State.CLOSING_TO_ONSET)
            called_off = await line.order(CommandName.CALL_OFF)
            assert called_off.done
            ended = await line.outcome(again.sequence)
            assert (ended.outcome, ended.reasons[0]) == ("NO_RESULT", Reason.CALLED_OFF)
            await line.publish(ended)

            unknown = await line.order(CommandName.CHANGE_RECIPE, 77)
            assert not unknown.done
            assert unknown.why is not None
            assert unknown.why.parameters["known"] == "1, 2, 3"
            assert not (await line.order(CommandName.SET_MODE, 4)).done
            assert (await line.order(CommandName.SET_MODE, 2)).done
            await cell.reach(State.IDLE)
            state = await line.state()
            assert not state.ready
            assert state.why_not_ready == readiness.NOT_PRODUCTION()
            assert (await line.begin(12)).refusal is Refusal.NOT_READY
            assert (await line.order(CommandName.SET_MODE, 1)).done
            assert (await line.ready()).mode == 1
            with pytest.raises(RefusedError, match="no inspection 999"):
                await line.outcome(999)

    asyncio.run(scenario())


def test_a_fruit_that_was_given_another_outcome_is_not_pressed_on(bench):
    async def scenario():
        async with bench() as cell:
            line = cell.line
            await cell.choose("blueberry")
            await line.ready()
            reply = await line.begin()
            await cell.reach(State.CLOSING_TO_ONSET)
            judged = []
            cell.at(State.JUDGING, lambda: judged.append(reply.sequence))
            lost = Outcome(
                sequence=reply.sequence, trigger_id=1, outcome="NO_RESULT", reasons=(Reason.STATION_LOST,),
                late=False, partial=True, simulated=True, area_mm2=None, area_px=None, closing_mm=None, confidence=None,
                recipe_number=2, recipe_checksum=0, began_utc_ms=0, ended_utc_ms=0, duration_ms=0, encoder=0, lot="",
            )  # fmt: skip
            await line.publish(lost)
            assert (await line.outcome(reply.sequence)).reasons[0] is Reason.STATION_LOST
            await line.ready()
            assert judged == []

    asyncio.run(scenario())


@pytest.mark.parametrize(
    ("fault", "alarm"),
    [
        ("can", AlarmId.CAN_NODE_LOST),
        ("reject", AlarmId.GATE_NOT_FIRED),
    ],
)
def test_what_the_line_tells_of_its_can_raises_its_own_alarm(bench, fault, alarm):
    async def scenario():
        async with bench() as cell:

            async def raised():
                word = (await cell.line.state(fault)).alarms
                known = (AlarmId.CAN_NODE_LOST, AlarmId.GATE_NOT_FIRED)
                return [one for one in known if word >> (ALARMS[one].number - 1) & 1]

            async with asyncio.timeout(30):
                while await raised() != [alarm]:
                    await asyncio.sleep(0.05)

    asyncio.run(scenario())


def test_a_deadline_under_the_recipes_longest_way_is_refused_with_the_remedy(bench):
    async def scenario():
        async with bench(inspection_deadline_s=1.0) as cell:
            with pytest.raises(AssertionError, match=r"deadline_too_short.*'allowed_s': 1\.0"):
                await cell.choose("strawberry")

    asyncio.run(scenario())


def test_the_papers_method_by_which_no_fruit_passes_is_refused_for_inspections(bench, settings_file, tmp_path):
    file, place = settings_file(), tmp_path / "recipes" / "blueberry.yaml"
    recipe = json.loads(place.read_text())
    recipe["segmentation"]["method"] = "paper"
    place.write_text(json.dumps(recipe))

    async def scenario():
        async with bench(file) as cell:
            done = await cell.line.order(CommandName.CHANGE_RECIPE, 2)
            assert done.why == NOT_FOR_INSPECTIONS(recipe="blueberry")
            await cell.choose("strawberry")

    asyncio.run(scenario())


def test_the_longest_deadline_that_a_site_may_set_is_told_with_the_answer(bench):
    async def scenario():
        async with bench(inspection_deadline_s=LONGEST_S) as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            reply = await cell.line.begin()
            await cell.line.publish(await cell.line.outcome(reply.sequence))
            return reply

    assert asyncio.run(scenario()).deadline_s == LONGEST_S + pacing.RECORD_NO_RESULT_S


def test_a_trigger_that_cannot_be_answered_keeps_no_later_one_waiting(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            with monkeypatch.context() as broken:
                broken.setattr(service, "RECORD_NO_RESULT_S", LONGEST_S)
                with pytest.raises(RefusedError, match="deadline_s"):
                    await cell.line.begin()
            cell.lay("blueberry", 2)
            return await cell.line.inspect(), (await cell.line.open()).outcomes

    after, (failed,) = asyncio.run(scenario())
    assert (failed.outcome, failed.reasons[0]) == ("NO_RESULT", Reason.INTERNAL_FAULT)
    assert after.sequence == failed.sequence + 1


def test_late_is_no_result(bench, monkeypatch):
    def quick(*of):  # a cell that needs longer than its recipe lets expect
        return deadlines(*of)._replace(longest_path_s=0.0)

    monkeypatch.setattr(pacing, "deadlines", quick)

    async def scenario():
        async with bench(inspection_deadline_s=1.0) as cell:
            await cell.choose("strawberry")
            outcome = await cell.line.inspect()
            assert AlarmId.DEADLINE_MISSED in {alarm.id for alarm in cell.station.service.alarms.alarms.active}
            return outcome

    outcome = asyncio.run(scenario())
    assert (outcome.outcome, outcome.reasons[0], outcome.late) == ("NO_RESULT", Reason.LATE, True)


def test_an_order_to_end_gives_the_outcome_first_and_opens_the_jaws(bench):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            reply = await cell.line.begin()
            await cell.reach(State.MOVING)
            awaited = asyncio.create_task(cell.line.outcome(reply.sequence))
            await asyncio.sleep(0)
            cell.station.stop()
            cell.station.stop()
            states = set()
            while not awaited.done():
                states.add((await cell.line.state()).packml_state)
            states.add((await cell.line.state()).packml_state)
            await cell.running
            return awaited.result(), states, cell.twin.world.opening_mm()

    outcome, states, opening_mm = asyncio.run(scenario())
    assert states - {PackmlState.EXECUTE} == {PackmlState.STOPPING}
    assert (outcome.outcome, outcome.reasons[0]) == ("NO_RESULT", Reason.CALLED_OFF)
    assert opening_mm == pytest.approx(85, abs=1)
