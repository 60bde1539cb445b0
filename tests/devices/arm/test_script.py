"""The control script's side of the register protocol, without a socket and with a clock that the test moves."""

import math

import pytest

from station.twin.ur.body import Body
from station.twin.ur.registers import Registers
from station.twin.ur.safety import Safety
from station.twin.ur.script import ControlScript, RuntimeState
from tests.manual_clock import ManualClock

HOME = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
READY, DONE = 1, 2


class Played:
    """A script that plays, and a client's hands on its registers."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        self.body = Body(HOME, 0.0)
        self.registers = Registers()
        self.safety = Safety(running=True)
        self.script = ControlScript(self.body, self.registers, self.safety)
        self.script.upload(0.0)
        self.run(0.1)
        assert self.script.runtime_state is RuntimeState.PLAYING

    def run(self, duration_s: float) -> None:
        for _ in range(round(duration_s / 0.002)):
            self.clock.advance(0.002)
            self.safety.advance(self.clock.now_s())
            self.body.advance(self.clock.now_s(), 1.0)
            self.script.step(self.clock.now_s())

    def write(self, command: int, doubles=(), integer: int = 0) -> None:
        now_s = self.clock.now_s()
        for i, value in enumerate(doubles):
            self.registers.write(f"input_double_register_{i}", value, now_s)
        self.registers.write("input_int_register_1", integer, now_s)
        self.registers.write("input_int_register_0", command, now_s)
        self.run(0.002)

    def clear(self) -> None:
        self.write(0)
        assert self.registers.output_int[0] == READY

    @property
    def reply(self) -> int:
        return self.registers.output_int[0]

    @property
    def progress(self) -> tuple[int, int, bool]:
        """Operation, count of writes, running."""
        value = self.registers.output_int[2]
        return value >> 24 & 127, value >> 16 & 127, bool(value & 1 << 15)


AWAY = (1.0, *HOME[1:])


def test_a_synchronous_move_is_done_when_it_has_arrived():
    played = Played()
    played.write(1, (*AWAY, 1.0, 2.0))
    assert played.reply == READY
    played.run(1.0)
    assert played.reply == READY
    played.run(0.6)
    assert played.reply == DONE
    assert played.body.joints_rad == pytest.approx(AWAY)
    played.run(0.1)
    assert played.reply == DONE
    played.clear()


def test_an_asynchronous_move_is_done_at_once_and_reports_its_end():
    played = Played()
    operation, writes, _ = played.progress
    played.write(1, (*AWAY, 1.0, 2.0), integer=1)
    assert played.reply == DONE
    assert played.progress == (operation + 1, writes + 1, True)
    played.clear()
    played.run(2.0)
    assert played.progress == (operation + 1, writes + 2, False)


def test_a_new_move_takes_the_place_of_one_under_way_without_a_jump():
    played = Played()
    played.write(1, (*AWAY, 1.0, 2.0), integer=1)
    played.clear()
    played.run(0.5)
    before = played.body.joints_rad
    played.write(1, (*HOME, 1.0, 2.0), integer=1)
    assert max(abs(a - b) for a, b in zip(before, played.body.joints_rad, strict=True)) < 0.01
    played.clear()
    played.run(2.0)
    assert played.body.joints_rad == pytest.approx(HOME)


@pytest.mark.parametrize(
    ("command", "doubles", "words"),
    [
        (1, (7.0, 0, 0, 0, 0, 0, 1.0, 1.0), "range"),
        (1, (*AWAY, 0.0, 1.0), "no motion"),
        (1, (math.nan, 0, 0, 0, 0, 0, 1.0, 1.0), "nan"),
        (2, (9.0, 0, 0, 0, 0, 0, 1.0, 1.0), "get_inverse_kin"),
        (46, (9.0, 0, 0, 0, 0, 0), "get_inverse_kin"),
        (34, (math.inf,), "inf"),
        (11, AWAY, "does not know"),
        (255, (), "client stopped"),
    ],
)
def test_what_ends_a_real_script_ends_this_one(command, doubles, words):
    played = Played()
    played.write(command, doubles)
    assert played.script.runtime_state is RuntimeState.STOPPED
    assert words in played.script.ended_because
    played.run(0.1)
    assert played.body.joints_rad == pytest.approx(HOME)


def test_a_stop_without_deceleration_ends_the_script_of_a_moving_arm():
    played = Played()
    played.write(1, (*AWAY, 1.0, 2.0), integer=1)
    played.clear()
    played.run(0.3)
    played.write(34, (0.0,))
    assert played.script.runtime_state is RuntimeState.STOPPED
    played.run(1.0)
    assert not played.body.moving


def test_a_straight_way_out_of_reach_is_a_protective_stop():
    played = Played()
    played.write(3, (9.0, 0, 0, 0, 0, 0, 0.25, 1.0))
    played.run(0.01)
    assert played.script.runtime_state is RuntimeState.PAUSED
    assert not played.safety.may_move
    played.clock.advance(5.0)
    assert played.safety.unlock(played.clock.now_s())
    played.run(0.002)
    assert played.script.runtime_state is RuntimeState.STOPPED


@pytest.mark.parametrize("straight", [False, True])
def test_a_safeguard_stop_pauses_the_program_and_its_motion_goes_on_afterwards(straight):
    played = Played()
    x, y, z, *turn = played.body.tool_pose()
    target = (x, y, z - 0.2, *turn) if straight else AWAY
    played.write(3 if straight else 1, (*target, 0.25, 1.0), integer=1)
    played.clear()
    played.run(0.3)
    played.safety.guard_open = True
    played.run(1.0)
    assert played.script.runtime_state is RuntimeState.PAUSED
    assert played.safety.bits == 1 << 4 | 1 << 10
    assert not played.body.moving
    assert played.progress[2]
    played.safety.guard_open = False
    played.run(6.0)
    assert played.script.runtime_state is RuntimeState.PLAYING
    reached = played.body.tool_pose() if straight else played.body.joints_rad
    assert reached == pytest.approx(target, abs=1e-6)
    assert not played.progress[2]


def test_a_program_that_was_stopped_while_the_guard_was_open_does_not_go_on():
    played = Played()
    played.write(1, (*AWAY, 1.0, 2.0), integer=1)
    played.clear()
    played.run(0.3)
    played.safety.guard_open = True
    played.run(0.1)
    played.script.end("the dashboard stopped the program")
    played.safety.guard_open = False
    played.run(2.0)
    assert played.script.runtime_state is RuntimeState.STOPPED
    assert not played.body.moving
    assert played.body.joints_rad[0] < 0.5


def test_the_watchdog_hears_every_write_and_stops_a_program_that_it_does_not_hear_from():
    played = Played()
    played.write(35, (5.0,))
    played.clear()
    for _ in range(10):
        played.run(0.15)
        played.clear()
    assert played.script.runtime_state is RuntimeState.PLAYING
    played.write(1, (*AWAY, 1.0, 2.0), integer=1)
    played.clear()
    played.run(0.25)
    assert played.script.ended_because == "the RTDE watchdog expired"
    played.run(0.5)
    assert not played.body.moving


def test_a_controller_that_stood_still_itself_does_not_blame_the_station():
    played = Played()
    played.write(35, (5.0,))
    played.clear()
    played.run(0.15)
    played.clock.advance(1.0)
    played.script.stood_still(played.clock.now_s())
    played.run(0.15)
    assert played.script.runtime_state is RuntimeState.PLAYING
    played.run(0.1)
    assert played.script.ended_because == "the RTDE watchdog expired"


def test_local_control_takes_no_program():
    played = Played()
    played.safety.remote = False
    played.run(0.01)
    assert played.script.runtime_state is RuntimeState.STOPPED
    played.script.upload(played.clock.now_s())
    played.run(0.2)
    assert played.script.runtime_state is RuntimeState.STOPPED
