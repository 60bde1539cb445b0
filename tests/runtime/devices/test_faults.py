"""Each device's faults in each phase: one outcome for each trigger, an alarm, and the station comes back."""

import asyncio

import pytest

from station.channel.line import CommandName
from station.inspection.alarm_table import AlarmId
from station.inspection.states import State
from station.vocabulary import Reason

FAULTS = [
    ("camera", "off", State.REFERENCE, Reason.CAMERA_FAULT, AlarmId.CAMERA_LOST),
    ("camera", "stuck", State.CLOSING_TO_ONSET, Reason.CAMERA_FAULT, AlarmId.CAMERA_STALE),
    ("camera", "frame_torn", State.SETTLING, Reason.CAMERA_FAULT, AlarmId.CAMERA_SATURATED),
    ("gripper", "off", State.CLOSING_TO_ONSET, Reason.GRIPPER_FAULT, AlarmId.GRIPPER_LINK_LOST),
    ("gripper", "garbage", State.MOVING, Reason.GRIPPER_FAULT, AlarmId.GRIPPER_LINK_LOST),
    ("gripper", "stuck", State.SETTLING, Reason.GRIPPER_FAULT, AlarmId.GRIPPER_JAM),
]


@pytest.mark.parametrize("faults", [FAULTS[:3], FAULTS[3:]], ids=["camera", "gripper"])
def test_a_fault_in_mid_inspection_is_one_no_result_and_passes(bench, faults):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            for device, fault, phase, reason, alarm in faults:
                await cell.line.ready()
                assert (await cell.line.order(CommandName.CLEAR_ALARMS)).done
                cell.at(phase, lambda device=device, fault=fault: cell.twin.boards[device].set(fault))
                reply = await cell.line.begin()
                outcome = await cell.line.outcome(reply.sequence)
                assert outcome.outcome == "NO_RESULT", fault
                assert reason in outcome.reasons, (fault, outcome)
                state = await cell.line.state()
                assert not state.ready
                assert state.why_not_ready
                # A jammed gripper still answers, and its alarm returns with the next answer; it is shown all the same.
                assert alarm in {shown.id for shown in cell.station.service.alarms.alarms.annunciated()}, fault
                cell.twin.boards[device].clear()
                await cell.line.publish(outcome)
            cell.lay("blueberry", 2)
            return await cell.line.inspect()

    after = asyncio.run(scenario())
    assert after.sequence == len(faults) + 1
    assert after.area_mm2 is not None
    assert not {reason for _, _, _, reason, _ in faults} & set(after.reasons)
