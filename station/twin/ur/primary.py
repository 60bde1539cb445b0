"""The primary stream, port 30001: the version message once, then the robot mode ten times a second.

Source: Universal Robots, "Client interfaces": version message (type 20, 3), robot mode data (type 16, sub-package 0).
"""

import struct
from typing import TYPE_CHECKING

from station.twin.ur.safety import SafetyMode
from station.twin.ur.script import RuntimeState

if TYPE_CHECKING:  # the controller makes these itself
    from station.twin.ur.controller import UrController

PORT = 30001
PERIOD_S = 0.1
CONNECTED_AND_ENABLED = (True, True)
PROJECT = b"URControl"
BUILT = b"01-11-2025, 00:00:00"
VERSION = struct.Struct(f">iBQbbb{len(PROJECT)}sBBii{len(BUILT)}s")
ROBOT_MODE = struct.Struct(">iBiBQ7?BBdddB")


def version_message(controller: "UrController") -> bytes:
    """The message that opens the stream."""
    major, minor, bugfix, build = controller.version
    return VERSION.pack(
        VERSION.size, 20, controller.timestamp_us, -2, 3, len(PROJECT), PROJECT, major, minor, bugfix, build, BUILT
    )


def robot_mode_message(controller: "UrController") -> bytes:
    """A robot state message that holds the robot mode data alone."""
    safety, script = controller.safety, controller.script
    return ROBOT_MODE.pack(
        ROBOT_MODE.size,
        16,
        # The sub-package: all but the message's own size and type.
        ROBOT_MODE.size - 5,
        0,
        controller.timestamp_us,
        *CONNECTED_AND_ENABLED,
        safety.powered,
        safety.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP,
        safety.safety_mode is SafetyMode.PROTECTIVE_STOP,
        script.runtime_state is RuntimeState.PLAYING,
        script.runtime_state is RuntimeState.PAUSED,
        safety.robot_mode,
        0,
        controller.speed_slider,
        controller.speed_scaling,
        1.0,
        0,
    )
