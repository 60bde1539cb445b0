"""Checks of the arm's state that several of its tests share, and a home pose that is far away."""

import pytest

from station.devices.arm.faults import REMEDIES, ArmCause, ArmFault
from station.devices.arm.ur import UrArm
from station.messages import arm as messages
from station.settings.arm import ArmPoses

AWAY = ArmPoses(home=(2.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0))
"""A home that is a long way off."""


A_TENTH = 9.0
"""Of its speed, by the fault `slow`: an arm that is to be stopped on its way does not arrive before, however busy the
machine."""


async def moving(bench) -> bool:
    return max(map(abs, bench.controller.body.speeds_rad_s)) > 0.1


async def cause_of(awaitable) -> ArmCause:
    with pytest.raises(ArmFault) as caught:
        await awaitable
    assert caught.value.message == messages.FAULT(cause=caught.value.detail, remedy=REMEDIES[caught.value.cause])
    return caught.value.cause


async def is_young(arm: UrArm) -> bool:
    """Return whether the state is less than 0.1 s old, which on a busy machine not each one is."""
    age_s = (await arm.state()).age_s
    return age_s is not None and 0.0 <= age_s < 0.1


async def has_cause(arm: UrArm, cause: ArmCause) -> bool:
    fault = (await arm.state()).fault
    return fault is not None and fault.cause is cause
