"""Whose stop it was: one on the pendant, or the watchdog's after a lapse of the station's health."""

import asyncio
import contextlib
from typing import Any

import pytest

from station.devices.arm import link
from station.devices.arm.dashboard import DashboardFacts
from station.devices.arm.diagnosis import PLAYING
from station.devices.arm.faults import ArmCause
from station.devices.arm.messages import Snapshot
from station.settings.arm import ArmSettings

SIX = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
STOPPED = PLAYING - 1


class Process:
    """The ur-rtde process of a powered arm in remote control."""

    state, kicks_late = PLAYING, False

    async def request(self, _request, _reply, *, deadline_s):
        return Snapshot(
            age_s=0.0,
            joints_rad=SIX,
            speeds_rad_s=SIX,
            tool_pose=SIX,
            robot_mode=7,
            safety_bits=1,
            runtime_state=self.state,
            commanding=True,
            underway=False,
            kicks_late=self.kicks_late,
        )


class Dashboard:
    async def facts(self):
        return DashboardFacts("5.22", "1", "UR10", "RUNNING", "NORMAL", remote=True)


@contextlib.asynccontextmanager
async def dashboard(_host):
    yield Dashboard()


@pytest.fixture
def cause_after(monkeypatch):
    """The cause of a stop after some beats; of each: is the station healthy, the program's state, late kicks."""
    monkeypatch.setattr(link, "dashboard", dashboard)

    def run(*beats):
        async def scenario():
            process: Any = Process()
            arm = link.ArmLink(ArmSettings())
            arm._process = process
            arm.renew_health(60.0)
            arm._up()
            for healthy, process.state, process.kicks_late in beats:
                arm.renew_health(60.0 if healthy else -0.05)
                await arm._watch(process)
            return arm.fault and arm.fault.cause

        return asyncio.run(scenario())

    return run


WELL, LAPSE = (True, PLAYING, False), (False, PLAYING, False)


@pytest.mark.parametrize(
    ("beats", "cause"),
    [
        ([WELL, (True, STOPPED, False)], ArmCause.PROGRAM_STOPPED),
        ([LAPSE, WELL, WELL, (True, STOPPED, False)], ArmCause.PROGRAM_STOPPED),
        ([LAPSE, (True, PLAYING, True), WELL, (True, STOPPED, False)], ArmCause.PROGRAM_STOPPED),
        ([LAPSE, LAPSE, (False, STOPPED, True)], ArmCause.WATCHDOG),
        ([LAPSE, (False, STOPPED, False)], ArmCause.WATCHDOG),
        ([LAPSE, (True, PLAYING, True), (True, STOPPED, True)], ArmCause.WATCHDOG),
        # The controller has stopped already, its state comes late, and the station is healthy again meanwhile.
        ([LAPSE, WELL, (True, STOPPED, True)], ArmCause.WATCHDOG),
        ([WELL, (True, STOPPED, True)], ArmCause.WATCHDOG),
    ],
)
def test_a_stop_is_the_watchdogs_only_where_it_was_left_without_kicks(cause_after, beats, cause):
    assert cause_after(*beats) is cause
