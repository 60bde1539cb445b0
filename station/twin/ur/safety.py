"""The controller's power, safety and operational mode, as its safety system and its pendant have them.

Robot modes, safety modes and the bits of the safety status are those of the RTDE guide (Universal Robots, "Real-Time
Data Exchange (RTDE) Guide") and of the dashboard server's guide. The times for power-on and brake release are
shortened. That a protective stop cannot be unlocked in its first 5 s is documented; the exact words of a refusal are
unverified on hardware.
"""

from enum import IntEnum

POWER_ON_S = 0.5
BRAKE_RELEASE_S = 0.5
UNLOCK_AFTER_S = 5.0


class RobotMode(IntEnum):
    """RTDE `robot_mode`."""

    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    RUNNING = 7


class SafetyMode(IntEnum):
    """RTDE `safety_mode`; the names are those that the dashboard server answers with."""

    NORMAL = 1
    PROTECTIVE_STOP = 3
    SAFEGUARD_STOP = 5
    ROBOT_EMERGENCY_STOP = 7
    FAULT = 9


SAFETY_BITS: dict[SafetyMode, int] = {
    SafetyMode.NORMAL: 1 << 0,
    SafetyMode.PROTECTIVE_STOP: 1 << 2 | 1 << 10,
    SafetyMode.SAFEGUARD_STOP: 1 << 4 | 1 << 10,
    SafetyMode.ROBOT_EMERGENCY_STOP: 1 << 6 | 1 << 7 | 1 << 10,
    SafetyMode.FAULT: 1 << 9 | 1 << 10,
}
"""RTDE `safety_status_bits` of each mode: normal 0, protective 2, safeguard 4, robot 6, any emergency 7, fault 9,
stopped 10."""


class Safety:
    """One state machine; every verb takes the clock's time and does nothing where it does not apply."""

    def __init__(self, *, running: bool) -> None:
        self.robot_mode = RobotMode.RUNNING if running else RobotMode.POWER_OFF
        self.remote = True
        self.guard_open = False
        self._emergency = False
        self._protective_since_s: float | None = None
        self._faulty = False
        self._target = self.robot_mode
        self._reached_at_s = 0.0

    @property
    def safety_mode(self) -> SafetyMode:
        """The mode that rules at the moment."""
        if self._emergency:
            return SafetyMode.ROBOT_EMERGENCY_STOP
        if self._faulty:
            return SafetyMode.FAULT
        if self._protective_since_s is not None:
            return SafetyMode.PROTECTIVE_STOP
        if self.guard_open and self.robot_mode is RobotMode.RUNNING:
            return SafetyMode.SAFEGUARD_STOP
        return SafetyMode.NORMAL

    @property
    def bits(self) -> int:
        """RTDE `safety_status_bits`."""
        return SAFETY_BITS[self.safety_mode]

    @property
    def powered(self) -> bool:
        """True while the joints have power."""
        return self.robot_mode in {RobotMode.IDLE, RobotMode.RUNNING}

    @property
    def may_move(self) -> bool:
        """True while a program may play."""
        return self.robot_mode is RobotMode.RUNNING and self.safety_mode is SafetyMode.NORMAL

    def advance(self, now_s: float) -> None:
        """Let power-on and brake release come to their ends."""
        if self.robot_mode is not self._target and now_s >= self._reached_at_s:
            self.robot_mode = self._target

    def power_on(self, now_s: float) -> bool:
        """Begin to power the joints; False where the safety system forbids it."""
        if self._emergency or self._faulty:
            return False
        # A second order while the power comes on must not begin it anew.
        if not self.powered and self._target is RobotMode.POWER_OFF:
            self.robot_mode, self._target = RobotMode.POWER_ON, RobotMode.IDLE
            self._reached_at_s = now_s + POWER_ON_S
        return True

    def release_brakes(self, now_s: float) -> bool:
        """Begin to release the brakes, powering on first where needed; False where the safety system forbids it."""
        if not self.power_on(now_s):
            return False
        if self.robot_mode is RobotMode.IDLE and self._target is RobotMode.IDLE:
            self._target = RobotMode.RUNNING
            self._reached_at_s = now_s + BRAKE_RELEASE_S
        elif self.robot_mode is RobotMode.POWER_ON:
            self._target = RobotMode.RUNNING
            self._reached_at_s = now_s + POWER_ON_S + BRAKE_RELEASE_S
        return True

    def power_off(self) -> None:
        """Take the joints' power away."""
        self.robot_mode = self._target = RobotMode.POWER_OFF

    def stop_protectively(self, now_s: float) -> None:
        """Enter the protective stop; the 5 s begin again where it is one already."""
        if self.robot_mode is RobotMode.RUNNING:
            self._protective_since_s = now_s

    def unlock(self, now_s: float) -> bool:
        """Leave the protective stop; False in its first 5 s."""
        if self._protective_since_s is None:
            return True
        if now_s - self._protective_since_s < UNLOCK_AFTER_S:
            return False
        self._protective_since_s = None
        return True

    def press_emergency_stop(self) -> None:
        """The red button on the pendant."""
        self._emergency = True
        self._protective_since_s = None
        self.power_off()

    def release_emergency_stop(self) -> None:
        """The button turned until it springs back; the arm stays without power."""
        self._emergency = False

    def fail(self) -> None:
        """A fault of the safety system."""
        self._faulty = True
        self.power_off()

    def restart(self) -> None:
        """Restart the safety system after a fault; the arm is without power afterwards."""
        if self._faulty:
            self._faulty = False
            self.power_off()
