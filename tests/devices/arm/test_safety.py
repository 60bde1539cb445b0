"""The controller's modes, run by hypothesis against what must always hold."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from station.twin.ur.safety import RobotMode, Safety, SafetyMode


class SafetyMachine(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.safety = Safety(running=True)
        self.now_s = 0.0
        self.pressed = False
        self.stopped_at_s = 0.0

    @rule(duration_s=st.floats(0.0, 4.0))
    def wait(self, duration_s):
        self.now_s += duration_s
        self.safety.advance(self.now_s)

    @rule()
    def power_on(self):
        assert self.safety.power_on(self.now_s) == (self.safety.safety_mode not in BLOCKING)

    @rule()
    def release_brakes(self):
        self.safety.release_brakes(self.now_s)

    @rule()
    def power_off(self):
        self.safety.power_off()

    @precondition(lambda self: self.safety.robot_mode is RobotMode.RUNNING)
    @rule()
    def stop_protectively(self):
        self.safety.stop_protectively(self.now_s)
        self.stopped_at_s = self.now_s
        assert not self.safety.may_move

    @rule()
    def unlock(self):
        was = self.safety.safety_mode
        allowed = self.safety.unlock(self.now_s)
        if was is SafetyMode.PROTECTIVE_STOP:
            assert allowed == (self.now_s - self.stopped_at_s >= 5.0)

    @rule()
    def press(self):
        self.safety.press_emergency_stop()
        self.pressed = True

    @rule()
    def release(self):
        self.safety.release_emergency_stop()
        self.pressed = False

    @rule()
    def fail(self):
        self.safety.fail()

    @rule()
    def restart(self):
        self.safety.restart()

    @invariant()
    def nothing_moves_without_power_brakes_and_safety(self):
        if self.safety.may_move:
            assert self.safety.robot_mode is RobotMode.RUNNING
            assert self.safety.safety_mode is SafetyMode.NORMAL
            assert not self.pressed

    @invariant()
    def a_pressed_button_is_an_emergency_stop_without_power(self):
        if self.pressed:
            assert self.safety.safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP
            assert not self.safety.powered

    @invariant()
    def the_bits_agree_with_the_mode(self):
        normal = self.safety.safety_mode is SafetyMode.NORMAL
        assert bool(self.safety.bits & 1) == normal
        assert bool(self.safety.bits & 1 << 10) != normal


BLOCKING = {SafetyMode.ROBOT_EMERGENCY_STOP, SafetyMode.FAULT}

TestSafety = SafetyMachine.TestCase
TestSafety.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)


def test_from_the_emergency_stop_back_to_running():
    safety = Safety(running=True)
    safety.press_emergency_stop()
    assert not safety.power_on(0.0)
    safety.release_emergency_stop()
    assert safety.robot_mode is RobotMode.POWER_OFF
    assert safety.power_on(0.0)
    safety.advance(0.6)
    assert safety.robot_mode is RobotMode.IDLE
    assert safety.release_brakes(0.6)
    safety.advance(1.2)
    assert safety.may_move


def test_a_protective_stop_cannot_be_unlocked_in_its_first_five_seconds():
    safety = Safety(running=True)
    safety.stop_protectively(1.0)
    assert not safety.unlock(5.99)
    assert safety.safety_mode is SafetyMode.PROTECTIVE_STOP
    assert safety.unlock(6.0)
    assert safety.may_move
