"""Whose stop it was: on the pendant, by the watchdog after a lapse of the station's health, or by an open guard."""

import asyncio
import contextlib
from types import SimpleNamespace
from typing import Any

import pytest

from station.devices.arm import link
from station.devices.arm.dashboard import DashboardFacts
from station.devices.arm.diagnosis import PLAYING, RUNNING
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import Outcome, Snapshot
from station.messages import arm as messages
from station.messages.message import verbatim
from station.settings.arm import ArmSettings

SIX = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
STOPPED = PLAYING - 1


class Process:
    """The ur-rtde process of a powered arm in remote control."""

    state, kicks_late, robot_mode, safety_bits, connected = PLAYING, False, RUNNING, 1, True

    async def request(self, _request, _reply, *, deadline_s):
        return Snapshot(
            age_s=0.0,
            joints_rad=SIX,
            speeds_rad_s=SIX,
            robot_mode=self.robot_mode,
            safety_bits=self.safety_bits,
            runtime_state=self.state,
            commanding=True,
            underway=False,
            connected=self.connected,
            kicks_late=self.kicks_late,
        )


class Commanded:
    """The ur-rtde process that gives no answer, or one, to the request for the commanding connection."""

    answer: Any = None

    async def request(self, request, _reply, *, deadline_s):
        if self.answer is None:
            silent = messages.PROCESS_SILENT(limit_s=deadline_s, request=request.meaning)
            raise ArmFault(ArmCause.DEADLINE, silent)
        return self.answer


class Dashboard:
    def __init__(self, requests):
        self._requests = requests

    async def request(self, command):
        self._requests.append(command)
        return "Stopped"

    async def facts(self):
        return DashboardFacts("5.22", "1", "UR10", "RUNNING", "NORMAL", remote=True)


@pytest.fixture
def dashboard_requests(monkeypatch):
    """The commands to the dashboard server."""
    requests: list[str] = []

    @contextlib.asynccontextmanager
    async def dashboard(_host):
        yield Dashboard(requests)

    monkeypatch.setattr(link, "dashboard", dashboard)
    return requests


def linked() -> tuple[link.ArmLink, Any]:
    """A link that is up, of a healthy station, and its process."""
    process: Any = Process()
    arm = link.ArmLink(ArmSettings())
    arm._process = process
    arm.renew_health(60.0)
    arm._up()
    return arm, process


@pytest.fixture
def cause_after(dashboard_requests):
    """The cause of a stop after some beats; of each: is the station healthy, the program's state, late kicks."""

    def run(*beats):
        async def scenario():
            arm, process = linked()
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


@pytest.mark.usefixtures("dashboard_requests")
@pytest.mark.parametrize("state", [PLAYING, STOPPED])
def test_a_connection_that_the_controller_closed_is_lost_whatever_was_received_last(state):
    """ur-rtde stops the program where it connects again by itself: that was no person at the pendant."""

    async def scenario():
        arm, process = linked()
        process.state, process.connected = state, False
        with pytest.raises(ArmFault) as watched:
            await arm._watch(process)
        with pytest.raises(ArmFault) as read:
            await arm.snapshot()
        assert watched.value.cause is read.value.cause is ArmCause.LINK_LOST
        assert arm.lost is read.value

    asyncio.run(scenario())


def test_registers_held_after_a_connection_that_was_cut_while_it_was_made_may_be_the_stations_own(monkeypatch):
    now_s = 100.0
    monkeypatch.setattr(link, "time", SimpleNamespace(monotonic=lambda: now_s))

    async def scenario():
        nonlocal now_s
        process: Any = Commanded()
        arm = link.ArmLink(ArmSettings())
        with pytest.raises(ArmFault) as cut:
            await arm._command(process)
        process.answer = Outcome(done=False, output=verbatim("RTDE input registers are already in use!"))
        for later_s in (1.0, 14.0):
            now_s += later_s
            with pytest.raises(ArmFault) as held:
                await arm._command(process)
            assert held.value.detail == messages.OWN_REGISTERS_HELD()
        now_s += 60.0
        await arm._command(process)
        return cut.value.cause, arm.fault and arm.fault.cause

    assert asyncio.run(scenario()) == (ArmCause.DEADLINE, ArmCause.REGISTERS_IN_USE)


@pytest.mark.usefixtures("dashboard_requests")
@pytest.mark.parametrize(
    ("robot_mode", "safety_bits"),
    [(RUNNING - 4, 1), (RUNNING, 1 << 2), (RUNNING - 4, 1 << 6)],
    ids=["no power", "protective stop", "emergency stop"],
)
def test_a_lapse_during_a_stop_does_not_make_it_the_watchdogs(robot_mode, safety_bits):
    """The station restarts by itself what the watchdog stopped; after a stop a person may be at the arm."""

    async def scenario():
        arm, process = linked()
        process.state, process.robot_mode, process.safety_bits = STOPPED, robot_mode, safety_bits
        for lease_s in (60.0, -0.05):
            arm.renew_health(lease_s)
            await arm._watch(process)
        arm.renew_health(60.0)
        process.robot_mode, process.safety_bits, process.kicks_late = RUNNING, 1, True
        await arm._watch(process)
        return arm.fault and arm.fault.cause

    assert asyncio.run(scenario()) is ArmCause.PROGRAM_STOPPED


PAUSED, RESUMING = 4, 5
GUARD_OPEN = 1 << 4 | 1 << 10


@pytest.mark.parametrize("afterwards", [STOPPED, PAUSED, RESUMING, PLAYING])
def test_a_program_that_an_open_guard_has_paused_is_stopped_and_the_guard_remains_the_cause(
    dashboard_requests, monkeypatch, afterwards
):
    monkeypatch.setattr(link, "END_AGAIN_S", 0.0)

    async def scenario():
        arm, process = linked()
        process.state, process.safety_bits = PAUSED, GUARD_OPEN
        await arm._watch(process)
        assert dashboard_requests == ["stop"]
        dashboard_requests.clear()
        arm.renew_health(-0.05)  # the watchdog is not kicked in a pause, and may have stopped the program
        process.state, process.safety_bits, process.kicks_late = afterwards, 1, True
        await arm._watch(process)
        assert dashboard_requests == ([] if afterwards is STOPPED else ["stop"])
        return arm.fault

    fault = asyncio.run(scenario())
    assert fault is not None
    assert fault.cause is ArmCause.SAFEGUARD_STOP


def test_a_paused_program_is_stopped_also_where_no_bit_shows_why_and_again_until_it_is(
    cause_after, dashboard_requests, monkeypatch
):
    monkeypatch.setattr(link, "END_AGAIN_S", 0.0)
    paused = (True, PAUSED, False)
    assert cause_after(WELL, paused, paused, (True, STOPPED, False), WELL) is ArmCause.PROGRAM_STOPPED
    assert dashboard_requests == ["stop", "stop"]
