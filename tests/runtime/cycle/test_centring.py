"""Centring over the twin's wire: a fruit laid off the middle is cut by the border at its place, and passes centred."""

import asyncio

import pytest

from station.channel.line import CommandName
from station.inspection.states import State
from station.press import motion, procedure
from station.runtime.cycle import actions
from tests.stored_inspection import read_record

FRUIT, RIGHT_MM, DOWN_MM = 16, 1.0, 0.8
TOUCHED_MM = 32.8
"""Where the sweep meets this fruit and how far it overshoots is left to the machine: by 1.1 mm the touch's middle moves
by 0.4 mm. So the middle is taken at this width, some 2 mm beyond the first touch."""


@pytest.mark.timeout(300)
def test_the_arm_follows_the_first_contact_and_the_fruit_that_the_border_cut_passes(bench, roomy, monkeypatch):
    sweeps = []

    async def swept(rig, *arguments):
        met = await motion.sweep(rig, *arguments)
        sweeps.append(met)
        await rig.close_to(TOUCHED_MM)
        return met

    monkeypatch.setattr(actions, "sweep", swept)
    monkeypatch.setattr(procedure, "sweep", swept)

    async def scenario():
        async with bench(roomy(bench=False)) as cell:
            assert (await cell.line.order(CommandName.CHANGE_RECIPE, 1)).done
            # The arm's program is uploaded, and the gripper activated at home.
            await cell.until(lambda: cell.phase is State.IDLE, patience_s=150)
            cell.lay("strawberry", FRUIT, x_mm=RIGHT_MM, y_mm=DOWN_MM)
            sensor_mm = []
            cell.at(State.RECORDING_ACCEPT, lambda: sensor_mm.append(cell.twin.world.sensor_mm()))
            outcome = await cell.line.inspect()
            await cell.reach(State.IDLE)
            record = read_record(cell.station.service.registry.records, outcome.sequence)
            return outcome, record.judged, sensor_mm, cell.twin.world.sensor_mm()

    outcome, judged, [sensor_mm], at_last = asyncio.run(scenario())
    assert outcome.outcome == "PASS", (outcome.reasons, judged.explanation, judged.curve, judged.measures)
    measures = judged.measures
    assert (measures["centring"], measures["closings"]) == ("moved", 1 + measures.get("presses", 1))
    assert not any("cut_by_border" in point.flags for point in judged.curve)
    assert (measures["off_right_mm"], measures["off_down_mm"]) == pytest.approx((RIGHT_MM, DOWN_MM), abs=0.4)
    assert sensor_mm == pytest.approx((measures["moved_right_mm"], measures["moved_down_mm"]), abs=0.03)
    assert measures["left_off_mm"] < 0.6
    assert len(sweeps) == 1, "where it was met, the fruit is not searched once more"
    assert {"opening_again", "centring"} <= set(judged.phases_s)
    assert at_last is None, "the arm waits above the nest again"
