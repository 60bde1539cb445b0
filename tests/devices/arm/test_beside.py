"""A place beside the nest: the offset's direction in the tool's own axes, its bound, and the way there."""

import asyncio
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.offset import offset_pose
from station.settings.arm import Centring
from station.twin.ur.kinematics import forward
from station.twin.ur.poses import pose_from_transform, transform_from_pose

TURNS = st.tuples(*[st.floats(-1.7, 1.7)] * 3)
OFFSETS = st.tuples(*[st.floats(-10, 10)] * 3)


@given(TURNS, OFFSETS)
def test_it_is_the_pose_moved_in_its_own_axes(turn, offset_mm):
    pose = (0.3, -0.2, 0.5, *turn)
    step = np.eye(4)
    step[:3, 3] = np.array(offset_mm) / 1000
    expected = pose_from_transform(transform_from_pose(pose) @ step)
    assert offset_pose(pose, offset_mm) == pytest.approx(expected, abs=1e-9)


def test_a_way_in_the_image_goes_along_the_axes_that_the_site_states():
    assert Centring().in_tool_mm(1.0, 2.0) == (1.0, 0.0, 2.0)
    assert Centring(image_right="-y", image_down="+x").in_tool_mm(1.0, 2.0) == (2.0, -1.0, 0.0)
    with pytest.raises(ValidationError, match="expected two axes, got z for both"):
        Centring(image_right="-z")


def test_the_arm_goes_beside_the_nest_and_no_farther_than_it_may(healthy_arm):
    async def run():
        async with healthy_arm() as (bench, arm):
            nest = forward(arm._settings.poses.nest)
            await arm.move_to("above_nest")
            await arm.move_to("nest")
            for offset_mm in ((1.5, 0.0, -2.0), (0.4, 0.0, 0.0), (0.0, 0.0, 0.0)):
                await arm.move_beside_nest(offset_mm)
                way_mm = 1000 * (np.linalg.inv(nest) @ forward(bench.controller.joints_rad))[:3, 3]
                assert way_mm == pytest.approx(offset_mm, abs=0.02)
                assert (await arm.state()).at == "nest"
            before = bench.controller.joints_rad
            with pytest.raises(ArmFault) as caught:
                await arm.move_beside_nest((2.2, 0.0, 2.2))
            assert caught.value.cause is ArmCause.UNREACHABLE
            assert math.dist(before, bench.controller.joints_rad) == 0
            await arm.move_to("above_nest")
            assert (await arm.state()).at == "above_nest"

    asyncio.run(run())
