"""From state bits, dashboard answers and ur-rtde's words to a cause."""

import pytest

from station.devices.arm.dashboard import DashboardFacts
from station.devices.arm.diagnosis import diagnose, from_output, from_state
from station.devices.arm.faults import REMEDIES, ArmCause
from station.devices.arm.messages import Snapshot
from station.messages import arm as messages
from station.messages.message import verbatim

SIX = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def snapshot(safety_bits=1, robot_mode=7, runtime_state=1) -> Snapshot:
    return Snapshot(
        age_s=0.0,
        joints_rad=SIX,
        speeds_rad_s=SIX,
        robot_mode=robot_mode,
        safety_bits=safety_bits,
        runtime_state=runtime_state,
        commanding=True,
        underway=False,
    )


def facts(*, remote=True) -> DashboardFacts:
    return DashboardFacts("5.22", "1", "UR10", "RUNNING", "NORMAL", remote)


@pytest.mark.parametrize(
    ("bits", "mode", "cause"),
    [
        (1, 7, None),
        (1, 3, ArmCause.NOT_POWERED),
        (1, 5, ArmCause.NOT_POWERED),
        (1 << 2 | 1 << 10, 7, ArmCause.PROTECTIVE_STOP),
        (1 << 4 | 1 << 10, 7, ArmCause.SAFEGUARD_STOP),
        (1 << 3, 7, ArmCause.SAFEGUARD_STOP),
        (1 << 10, 7, ArmCause.SAFEGUARD_STOP),
        (1 << 10, 5, ArmCause.SAFEGUARD_STOP),
        (1 << 5, 3, ArmCause.EMERGENCY_STOP),
        (1 << 6 | 1 << 7 | 1 << 2, 3, ArmCause.EMERGENCY_STOP),
        (1 << 8, 3, ArmCause.SAFETY_FAULT),
        (1 << 9 | 1 << 2, 3, ArmCause.SAFETY_FAULT),
    ],
)
def test_the_gravest_cause_that_the_state_shows_is_named(bits, mode, cause):
    fault = from_state(snapshot(bits, mode))
    assert (fault and fault.cause) == cause


@pytest.mark.parametrize(
    ("state", "remote", "healthy", "cause"),
    [
        (snapshot(1 << 2), False, False, ArmCause.PROTECTIVE_STOP),
        (snapshot(), False, False, ArmCause.LOCAL_CONTROL),
        (snapshot(), True, False, ArmCause.WATCHDOG),
        (snapshot(), True, True, ArmCause.PROGRAM_STOPPED),
        (snapshot(runtime_state=2), True, True, ArmCause.DEADLINE),
    ],
)
def test_what_was_not_done_has_one_cause(state, remote, healthy, cause):
    assert diagnose(state, facts(remote=remote), None, was_healthy=healthy).cause is cause


@pytest.mark.parametrize(
    ("words", "cause"),
    [
        ("ur_rtde: Please enable remote control on the robot!", ArmCause.LOCAL_CONTROL),
        ("One of the RTDE input registers are already in use! Currently you must …", ArmCause.REGISTERS_IN_USE),
        ("Error: Could not connect to: 127.0.0.2 at 30004, verify the IP", ArmCause.LINK_LOST),
        ("Timeout connecting to UR dashboard server.", ArmCause.LINK_LOST),
        ("End of file", ArmCause.LINK_LOST),  # Boost.Asio's, of a connection that was cut in the constructor
        ("ur_rtde: Failed to start control script, before timeout of 5 seconds", None),
    ],
)
def test_ur_rtdes_own_words_are_understood(words, cause):
    fault = from_output(verbatim(words))
    assert (fault and fault.cause) == cause


@pytest.mark.parametrize("output", [None, verbatim("ur_rtde: the script ended"), messages.NOT_COMMANDED()])
@pytest.mark.parametrize("playing", [False, True])
def test_ur_rtdes_output_is_part_of_the_fault(playing, output):
    fault = diagnose(snapshot(runtime_state=2 if playing else 1), facts(), output, was_healthy=True)
    assert fault.detail.parameters.get("reason") == output


def test_the_stations_own_words_are_not_searched_for_a_cause():
    assert from_output(None) is None
    assert from_output(messages.LOCAL_CONTROL()) is None


def test_every_cause_has_a_remedy():
    assert set(REMEDIES) == set(ArmCause)
