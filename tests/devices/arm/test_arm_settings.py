"""Settings of the arm: the defaults, and the values that are refused."""

import pytest
from pydantic import ValidationError

from station.settings.arm import ArmPoses, ArmSettings


def test_the_defaults_suit_the_twin_and_have_the_remote_control_check_done():
    assert ArmSettings().host not in {"localhost", "127.0.0.1", "192.168.56.101"}


def test_the_defaults_are_as_impatient_as_ur_rtde_needs():
    defaults = ArmSettings()
    assert (defaults.stale_after_s, defaults.constructor_limit_s) == (0.1, 8.0)
    assert defaults.link_lost_after_s < 1.0


def test_poses_come_as_lists_from_a_file():
    assert ArmPoses.model_validate({"nest": [0, 1, 2, 3, 4, 5]}).joints_rad("nest") == (0.0, 1.0, 2.0, 3.0, 4.0, 5.0)


@pytest.mark.parametrize(
    "change",
    [
        {"joint_speed_rad_s": 3.15},
        {"joint_speed_rad_s": 0.0},
        {"joint_acceleration_rad_s2": 40.1},
        {"tool_speed_mm_s": 3001.0},
        {"tool_acceleration_mm_s2": 150_001.0},
        {"host": ""},
        {"host": "arm;reboot"},
        {"poses": {"home": [0.0] * 5}},
        {"poses": {"home": [0.0] * 5 + [6.3]}},
        {"poses": {"home": [0.0] * 5 + [float("nan")]}},
        {"poses": {"home": ["0"] * 6}},
        {"poses": {"lunch": [0.0] * 6}},
        {"watchdog_hz": 0.0},
        {"stop_deceleration_rad_s2": 2.0},
        {"speed": 1.0},
    ],
)
def test_what_ur_rtde_or_the_arm_would_not_take_is_refused(change):
    with pytest.raises(ValidationError):
        ArmSettings.model_validate(change)
