"""Straight motions of the tool: chosen by the arm's position, not by the pose that it was sent to before."""

import asyncio
from typing import Any

import numpy as np
import pytest

from station.devices.arm.diagnosis import PLAYING, RUNNING
from station.devices.arm.messages import Beside, Move, Outcome, Snapshot
from station.devices.arm.ur import UrArm
from station.settings.arm import ArmSettings
from station.twin.ur.kinematics import forward, inverse, nearest
from station.twin.ur.paths import ToolPath

SETTINGS = ArmSettings.model_validate({"centring": {"most_mm": 10.0}})
POSES = SETTINGS.poses
SIX = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
BETWEEN = (0.2, -1.5, 1.6, -1.7, -1.5708, 0.2)
"""Far from every place: on the way from one of the others."""


def beside(offset_mm):
    """The joint positions at the nest moved along the tool's axes."""
    flange = forward(POSES.nest)
    flange[:3, 3] += flange[:3, :3] @ np.array(offset_mm) / 1000
    joints = nearest(inverse(flange[None])[0], POSES.nest)
    assert joints is not None
    return joints


class Link:
    """A controller whose arm is where it was sent at once; a person may move it."""

    fault, lost, healthy, attachment = None, None, True, 1

    def __init__(self):
        self.joints_rad, self.straight = POSES.home, []

    async def snapshot(self):
        return Snapshot(
            age_s=0.0,
            joints_rad=self.joints_rad,
            speeds_rad_s=SIX,
            robot_mode=RUNNING,
            safety_bits=1,
            runtime_state=PLAYING,
            commanding=True,
            underway=False,
        )

    async def order(self, request):
        if isinstance(request, Beside):
            return Outcome(done=True, joints_rad=beside(request.offset_mm))
        if isinstance(request, Move):
            self.joints_rad = request.joints_rad
            self.straight.append(request.straight)
        return Outcome(done=True)


@pytest.fixture
def is_straight():
    """Return a check that the arm goes straight to a pose from where it was found after its last motion."""

    def check(last, found_rad, pose):
        async def run():
            arm: Any = UrArm(SETTINGS)
            arm._link = link = Link()
            await arm.move_to("above_nest")
            if isinstance(last, str):
                await arm.move_to(last)
            else:
                await arm.move_beside_nest(last)
            # The program was stopped and played again; a person may have moved the arm meanwhile.
            link.joints_rad = link.joints_rad if found_rad is None else found_rad
            link.attachment += 1
            await arm.move_to(pose)
            return link.straight[-1]

        return asyncio.run(run())

    return check


@pytest.mark.parametrize(
    ("last", "found_rad", "straight"),
    [
        ("nest", None, True),
        ((0.0, 0.0, 2.0), None, True),
        ((0.0, 0.0, 10.0), None, True),
        ("home", POSES.nest, True),
        ("reject", POSES.nest, True),
        ((0.0, 0.0, 2.0), POSES.nest, True),
        ("home", beside((0.0, 3.0, 0.0)), True),
        ("home", None, False),
        ("nest", POSES.home, False),
        ("nest", POSES.reject, False),
        ((0.0, 0.0, 2.0), POSES.accept, False),
        ("nest", BETWEEN, False),
        ("reject", BETWEEN, False),
    ],
)
def test_an_arm_leaves_the_nest_straight_and_nothing_else(is_straight, last, found_rad, straight):
    assert is_straight(last, found_rad, "above_nest") is straight


@pytest.mark.parametrize("last", ["above_nest", "nest"])
@pytest.mark.parametrize("offset_mm", [SIX[:3], *map(tuple, 10 * np.vstack([np.eye(3), -np.eye(3)]))])
def test_an_arm_stopped_anywhere_on_its_way_to_or_from_the_nest_goes_on_straight(is_straight, last, offset_mm):
    way = ToolPath(beside(offset_mm), forward(beside(offset_mm)), forward(POSES.above_nest))
    for part in np.linspace(0.0, 0.97, 30):
        found_rad = tuple(map(float, way.at(part * way.length)[0]))
        assert is_straight(last, found_rad, "above_nest"), (part, found_rad)


def test_the_way_to_the_nest_is_straight_from_everywhere(is_straight):
    for found_rad in (POSES.above_nest, POSES.home, BETWEEN):
        assert is_straight("home", found_rad, "nest")
