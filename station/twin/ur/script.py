"""Controller's part of ur-rtde's control script, while it plays.

The uploaded text is recognised and not interpreted: this is the script's side of ur-rtde's register protocol, read from
ur-rtde 1.6.5 (`scripts/rtde_control.script`, `include/ur_rtde/rtde.h`). `output_int_register_0` says ready (1) or done
(2); `input_int_register_0` is the command; `output_int_register_2` reports asynchronous motion.
"""

from collections.abc import Callable
from enum import IntEnum

from station.twin.ur.body import NO_OFFSET, Body
from station.twin.ur.kinematics import Joints
from station.twin.ur.paths import UnreachableError
from station.twin.ur.poses import Pose, pose_from_transform, transform_from_pose
from station.twin.ur.registers import Registers
from station.twin.ur.safety import Safety, SafetyMode

START_S = 0.05
"""From the upload to the script's first cycle; a real controller compiles for some hundred milliseconds."""
SAFETY_BRAKE_RAD_S2 = 15.0
READY, DONE = 1, 2
WATCHED = "input_int_register_0"


class RuntimeState(IntEnum):
    """RTDE `runtime_state`."""

    STOPPED = 1
    PLAYING = 2
    PAUSED = 4


class ScriptEndError(Exception):
    """The script ends by itself or by an error in it."""


class ControlScript:
    """The script's state from upload to upload."""

    def __init__(self, body: Body, registers: Registers, safety: Safety) -> None:
        self._body, self._registers, self._safety = body, registers, safety
        self.runtime_state = RuntimeState.STOPPED
        self.payload_kg = 0.0
        self.payload_cog_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self.ended_because = "no program was started"
        self._starts_at_s: float | None = None
        self._busy: Callable[[], bool] | None = None
        self._executing = False
        self._async_running = False
        self._resumes = False
        self._stops_straight = False
        self._watchdog_s: float | None = None
        self._watched_since_s = 0.0
        self._now_s = 0.0
        self._operation = 0
        self._writes = 0
        self._commands: dict[int, Callable[[], Callable[[], bool] | None]] = {
            1: lambda: self._move(self._start_joint_move),
            2: lambda: self._move(self._start_pose_move),
            3: lambda: self._move(lambda: self._move_tool(self._pose())),
            4: lambda: self._move(lambda: self._move_tool(self._body.forward(self._joints(), self._body.tcp_offset))),
            17: self._set_payload,
            26: lambda: self._answer(0.002),
            27: lambda: self._answer(*self._body.joints_rad),
            28: lambda: self._answer(*self._body.tool_pose()),
            29: self._set_tcp,
            30: lambda: self._inverse(self._joints(6)),
            31: self._protective_stop,
            33: self._stop_motion,
            34: self._stop_motion,
            35: self._set_watchdog,
            36: lambda: self._say(self._body.solve(self._pose()) is not None),
            37: lambda: self._say(self._body.within_range(self._joints())),
            38: lambda: self._answer(*(0.0,) * 6),
            39: lambda: self._answer(
                *pose_from_transform(transform_from_pose(self._pose()) @ transform_from_pose(self._pose(6)))
            ),
            40: lambda: self._answer(*self._body.tcp_offset),
            43: lambda: self._answer(*self._body.tool_pose()),
            44: lambda: self._answer(*self._body.forward(self._joints(), self._pose(6))),
            46: lambda: self._inverse(None),
            47: lambda: self._say(self._body.steady),
            58: lambda: self._answer(*self._body.forward(self._body.joints_rad, NO_OFFSET)),
            60: lambda: self._say(self._body.solve(self._pose()) is not None),
            61: lambda: self._say(self._body.solve(self._pose(), self._joints(6)) is not None),
        }
        # The script answers these in every cycle and stays ready: their client waits for no DONE.
        self._realtime = {26, 27, 38, 58}

    def upload(self, now_s: float) -> None:
        """A control script has arrived: it replaces the one that plays, if the controller may play at all."""
        if self._safety.remote and self._safety.may_move:
            self.end("another program was started")
            self._starts_at_s = now_s + START_S

    def end(self, why: str) -> None:
        """Stop the program and brake the arm."""
        self._starts_at_s = None
        if self.runtime_state is RuntimeState.STOPPED:
            return
        self.runtime_state = RuntimeState.STOPPED
        self.ended_because = why
        self._busy = None
        self._watchdog_s = None
        self._body.brake(SAFETY_BRAKE_RAD_S2)

    def stood_still(self, now_s: float) -> None:
        """The controller itself did nothing for a while: what it has not read yet is no silence of the station."""
        self._watched_since_s = max(self._watched_since_s, now_s)

    def step(self, now_s: float) -> None:
        """One cycle of the controller."""
        self._now_s = now_s
        self._follow_safety()
        if self._starts_at_s is not None and now_s >= self._starts_at_s:
            self._start(now_s)
        if self.runtime_state is not RuntimeState.PLAYING:
            return
        if self._async_running and not self._body.moving:
            self._async_running = False
            self._report(-1)
        if self._watchdog_s is not None:
            heard_s = max(self._registers.written_at_s.get(WATCHED, 0.0), self._watched_since_s)
            if now_s - heard_s > self._watchdog_s:
                self.end("the RTDE watchdog expired")
                return
        try:
            self._serve(now_s)
        except ScriptEndError as stop:
            self.end(str(stop))
        except (UnreachableError, ValueError, ZeroDivisionError) as error:
            self.end(f"the script failed: {error}")

    def _start(self, now_s: float) -> None:
        self._starts_at_s = None
        self.runtime_state = RuntimeState.PLAYING
        self._executing = self._async_running = self._stops_straight = False
        self._busy = None
        self._watched_since_s = now_s
        self._report(-1)
        self._registers.output_int[0] = READY

    def _follow_safety(self) -> None:
        if self._safety.may_move and self._safety.remote:
            if self.runtime_state is RuntimeState.PAUSED and self._resumes:
                self.runtime_state = RuntimeState.PLAYING
                self._watched_since_s = self._now_s  # whether a real watchdog expires in a pause is not known
                self._body.resume()
            elif self.runtime_state is RuntimeState.PAUSED:
                self.end("the protective stop was unlocked")
            return
        if self._safety.powered and self._safety.remote and self.runtime_state is RuntimeState.PLAYING:
            self.runtime_state, self._resumes = RuntimeState.PAUSED, True
            self._body.pause(SAFETY_BRAKE_RAD_S2)
        if self._safety.safety_mode is not SafetyMode.SAFEGUARD_STOP:
            # After a safeguard stop alone the motion continues by itself; any other stop ends the program.
            self._resumes = False
        if not self._safety.powered or not self._safety.remote:
            self.end("the arm lost its power" if self._safety.remote else "the controller was put into local control")

    def _serve(self, now_s: float) -> None:
        if self._busy is not None:
            if not self._busy():
                return
            self._busy = None
            self._registers.output_int[0] = DONE
        command = self._registers.input_int(0)
        if command == 0:
            self._executing = False
            self._registers.output_int[0] = READY
        elif command in self._realtime:
            self._commands[command]()
        # A command stays in its register until the client clears it: it is begun once.
        elif not self._executing:
            self._executing = True
            self._watched_since_s = now_s
            self._begin(command)

    def _begin(self, command: int) -> None:
        if command == 255:
            raise ScriptEndError("the client stopped the script")
        if command not in self._commands:
            raise ScriptEndError(f"the emulated controller does not know the script's command {command}")
        self._busy = self._commands[command]()
        if self._busy is None:
            self._registers.output_int[0] = DONE

    def _move(self, start: Callable[[], None]) -> Callable[[], bool] | None:
        if self._async_running:
            self._async_running = False
            self._report(-1)
        start()
        if self._registers.input_int(1) != 1:
            return lambda: not self._body.moving
        # After the start: where that raises, the script ends and no motion is reported as running.
        self._report(0)
        self._async_running = True
        return None

    def _start_joint_move(self) -> None:
        speed, acceleration = self._registers.input_doubles(6, 2)
        self._body.move_joints(self._joints(), speed, acceleration)

    def _start_pose_move(self) -> None:
        speed, acceleration = self._registers.input_doubles(6, 2)
        joints = self._body.solve(self._pose())
        if joints is None:
            raise ScriptEndError("the script failed: get_inverse_kin found no solution")
        self._body.move_joints(joints, speed, acceleration)

    def _move_tool(self, pose: Pose) -> None:
        speed, acceleration = self._registers.input_doubles(6, 2)
        try:
            self._body.move_tool(pose, speed, acceleration)
        except UnreachableError:
            self._safety.stop_protectively(self._now_s)

    def _stop_motion(self) -> Callable[[], bool] | None:
        # The script sets its `stop_type` in asynchronous stops alone, and always to stopl; until then it is stopj.
        if self._async_running:
            self._report(-1)
        self._async_running = self._registers.input_int(1) == 1
        self._stops_straight |= self._async_running
        (deceleration,) = self._registers.input_doubles(0, 1)
        if self._stops_straight:
            self._body.brake_tool(deceleration)
        else:
            self._body.brake(deceleration)
        if self._async_running:
            self._report(0)
            return None
        return lambda: not self._body.moving

    def _protective_stop(self) -> Callable[[], bool]:
        self._safety.stop_protectively(self._now_s)
        return lambda: False

    def _set_watchdog(self) -> None:
        frequency_hz = self._registers.input_doubles(0, 1)[0]
        self._watchdog_s = 1.0 / frequency_hz if frequency_hz > 0 else None

    def _set_payload(self) -> None:
        self.payload_kg, x, y, z = self._registers.input_doubles(0, 4)
        self.payload_cog_m = (x, y, z)

    def _set_tcp(self) -> None:
        self._body.tcp_offset = self._pose()

    def _inverse(self, near: Joints | None) -> None:
        joints = self._body.solve(self._pose(), near)
        if joints is None:
            raise ScriptEndError("the script failed: get_inverse_kin found no solution")
        self._answer(*joints)

    def _say(self, yes: bool) -> None:  # noqa: FBT001 (the answer itself)
        self._registers.output_int[1] = int(yes)

    def _answer(self, *values: float) -> None:
        self._registers.output_double[: len(values)] = values

    def _pose(self, first: int = 0) -> Pose:
        x, y, z, rx, ry, rz = self._registers.input_doubles(first, 6)
        return x, y, z, rx, ry, rz

    _joints = _pose

    def _report(self, progress: int) -> None:
        """Bits 30-24 operation, 23-16 count of writes, 15 running, 14-0 progress; 0 begins one, -1 ends it."""
        self._writes = (self._writes + 1) % 128
        if progress == 0:
            self._operation = (self._operation + 1) % 128
        running = 1 << 15 | progress if progress >= 0 else 0
        self._registers.output_int[2] = self._operation << 24 | self._writes << 16 | running
