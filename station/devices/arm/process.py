"""ur-rtde process: `python -m station.devices.arm.process ENDPOINT HOST FREQUENCY PARENT`.

ur-rtde's constructors hold the interpreter's lock, hang on a silent peer, and a dropped link ends the process with a
segmentation fault. So there is one such process for each connection; its parent kills it when it does not answer, and
the kernel kills it when the parent dies, which works even while ur-rtde holds the lock.
"""

import asyncio
import ctypes
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface

from station.channel.server import ChannelServer
from station.child_process import end_with
from station.devices.arm.age import TimestampAge
from station.devices.arm.diagnosis import PLAYING
from station.devices.arm.messages import (
    Beat,
    Beside,
    Command,
    Halt,
    Move,
    Outcome,
    Reachable,
    Snapshot,
    Start,
    Upload,
    Watch,
)
from station.devices.arm.offset import offset_pose
from station.errors import StationError
from station.messages import arm as messages
from station.messages.message import message_of

VARIABLES = ["timestamp", "actual_q", "actual_qd", "robot_mode", "safety_status_bits", "runtime_state"]
UPLOAD_S = 2.0
POLL_S = 0.01
KICKS_PER_LIMIT = 4
PR_SET_TIMERSLACK = 29
"""prctl(2)."""
TIMER_SLACK_NS = 1_000_000
"""Half of the controller's fastest cycle: the longest delay between a state's arrival and its use."""


class UrRtdeProcess:
    """Handlers of the channel. All that commands the arm runs in one thread, one after the other."""

    def __init__(self, host: str, frequency_hz: float) -> None:
        self._host, self._frequency_hz = host, frequency_hz
        self._control: RTDEControlInterface | None = None
        self._receive: RTDEReceiveInterface | None = None
        self._age = TimestampAge()
        self._commander = ThreadPoolExecutor(max_workers=1)
        self._healthy_until_s = 0.0
        self._kicking: asyncio.Task[None] | None = None
        self._kicked_s = 0.0
        self._kicks_late = self._played = False

    async def start(self, _request: Start) -> Outcome:
        """Answer, which this process can once it runs."""
        return Outcome(done=True)

    async def watch(self, _request: Watch) -> Outcome:
        """Open the receiving connection; this holds the interpreter's lock until it is open."""
        try:
            self._receive = RTDEReceiveInterface(self._host, self._frequency_hz, VARIABLES)
        except Exception as error:  # noqa: BLE001 (any error of ur-rtde is an answer)
            return Outcome(done=False, output=message_of(error))
        return Outcome(done=True)

    async def command(self, request: Command) -> Outcome:
        """Open the commanding connection; this holds the interpreter's lock until it is open."""
        try:
            control = RTDEControlInterface(self._host, self._frequency_hz)
        except Exception as error:  # noqa: BLE001 (any error of ur-rtde is an answer)
            return Outcome(done=False, output=message_of(error))
        self._control = control
        self._set_up = request
        if self._kicking is None:
            self._kicking = asyncio.create_task(self._kick(1.0 / (request.watchdog_hz * KICKS_PER_LIMIT)))
        return await self._on_arm(self._prepare)

    async def upload(self, _request: Upload) -> Outcome:
        """Send the program again; ur-rtde's own result is not reliable, only a playing program counts."""
        return await self._on_arm(lambda: self._commanding().reuploadScript() and self._plays() and self._prepare())

    async def beat(self, request: Beat) -> Snapshot:
        """Return the state."""
        receive = self._receive
        if receive is None:
            raise StationError(messages.STATE_NOT_RECEIVED())
        self._healthy_until_s = time.monotonic() + request.healthy_for_s
        age_s = self._age.age_s(receive.getTimestamp(), time.monotonic())
        progress = self._control.getAsyncOperationProgressEx() if self._control is not None else None
        return Snapshot(
            # Of the receiving connection: the commanding one's tells nothing while ur-rtde reconnects that by itself,
            # which stops the program and often ends this process.
            connected=receive.isConnected(),
            age_s=age_s,
            joints_rad=tuple(receive.getActualQ()),
            speeds_rad_s=tuple(receive.getActualQd()),
            robot_mode=receive.getRobotMode(),
            safety_bits=receive.getSafetyStatusBits(),
            runtime_state=receive.getRuntimeState(),
            commanding=self._control is not None,
            underway=progress is not None and progress.isAsyncOperationRunning(),
            # Computed now: when the state was last read for it, the stop that is shown may not have happened yet.
            kicks_late=self._kicks_late or self._late(),
        )

    async def move(self, request: Move) -> Outcome:
        """Start a motion."""
        joints = list(request.joints_rad)

        def begin() -> bool:
            control = self._commanding()
            if request.straight:
                return control.moveL_FK(joints, request.speed / 1000, request.acceleration / 1000, True)  # noqa: FBT003
            return control.moveJ(joints, request.speed, request.acceleration, True)  # noqa: FBT003

        return await self._on_arm(begin)

    async def beside(self, request: Beside) -> Outcome:
        """Compute the joint positions for an offset by the controller; not done if there are none."""
        joints = list(request.joints_rad)
        found: list[float] = []

        def ask() -> bool:
            control = self._commanding()
            x, y, z, rx, ry, rz = control.getForwardKinematics(joints, self._tool())
            pose = list(offset_pose((x, y, z, rx, ry, rz), request.offset_mm))
            # Checked first: without a solution URScript's get_inverse_kin ends the control program by an exception.
            if not control.getInverseKinematicsHasSolution(pose, joints):
                return False
            found.extend(control.getInverseKinematics(pose, joints))
            return True

        outcome = await self._on_arm(ask)
        return outcome.model_copy(update={"joints_rad": tuple(found)}) if outcome.done else outcome

    async def reachable(self, request: Reachable) -> Outcome:
        """Check joint positions, and the tool's pose at them, by the controller."""
        joints = list(request.joints_rad)

        def ask() -> bool:
            control = self._commanding()
            if not control.isJointsWithinSafetyLimits(joints):
                return False
            pose = control.getForwardKinematics(joints, self._tool())
            return control.isPoseWithinSafetyLimits(pose) and control.getInverseKinematicsHasSolution(pose)

        return await self._on_arm(ask)

    async def halt(self, request: Halt) -> Outcome:
        """Brake to rest. Not asynchronously: then ur-rtde's program runs stopl, with the number taken as m/s²."""

        def brake() -> bool:
            self._commanding().stopJ(request.deceleration_rad_s2)
            return True

        return await self._on_arm(brake)

    async def _kick(self, period_s: float) -> None:
        """Kick the controller's watchdog as long as the health lease runs."""
        while True:
            await asyncio.sleep(period_s)
            if self._control is None:
                continue
            playing = self._playing()
            if self._played:  # a program that was not kicked in time and plays on was not stopped by that
                self._kicks_late = self._late() or (self._kicks_late and not playing)
            self._played = playing
            if playing and time.monotonic() < self._healthy_until_s:
                await self._on_arm(self._kick_watchdog)

    def _kick_watchdog(self) -> bool:
        begun_s = time.monotonic()
        taken = self._commanding().kickWatchdog()
        self._kicked_s = begun_s
        return taken

    def _late(self) -> bool:
        """Return whether the watchdog may have stopped a program that was playing when last read.

        The limit counts from the start of a kick, before which the controller cannot have received it. So every stop
        by the watchdog counts as late, however long this process waited for the processor meanwhile.
        """
        return self._played and time.monotonic() - self._kicked_s > 1.0 / self._set_up.watchdog_hz

    def _prepare(self) -> bool:
        control, wanted, begun_s = self._commanding(), self._set_up, time.monotonic()
        centre_m = [value / 1000 for value in wanted.payload_centre_mm]
        prepared = (
            control.setTcp(self._tool())
            and control.setPayload(wanted.payload_kg, centre_m)
            and control.setWatchdog(wanted.watchdog_hz)
        )
        self._kicked_s, self._kicks_late, self._played = begun_s, False, True
        return prepared

    def _tool(self) -> list[float]:
        # Never all zeros: for those ur-rtde's getForwardKinematics leaves the offset's registers as they were.
        x, y, z = (value / 1000 for value in self._set_up.tool_centre_mm)
        return [x, y, z or 1e-9, 0.0, 0.0, 0.0]

    def _commanding(self) -> RTDEControlInterface:
        if self._control is None:
            raise StationError(messages.NOT_COMMANDED())
        return self._control

    def _playing(self) -> bool:
        return self._receive is not None and self._receive.getRuntimeState() == PLAYING

    def _plays(self) -> bool:
        deadline_s = time.monotonic() + UPLOAD_S
        while time.monotonic() < deadline_s:
            if self._commanding().isProgramRunning():
                return True
            time.sleep(POLL_S)
        return False

    async def _on_arm(self, call: Callable[[], bool]) -> Outcome:
        try:
            done = await asyncio.get_running_loop().run_in_executor(self._commander, call)
        except Exception as error:  # noqa: BLE001 (any error of ur-rtde is an answer)
            return Outcome(done=False, output=message_of(error))
        return Outcome(done=done)


def relax_timers() -> None:
    """Let the kernel wake this thread, and all that it starts from now on, a little later than requested.

    ur-rtde's threads poll their sockets every 0.1 ms, which costs more than all data that they read.
    """
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_TIMERSLACK, TIMER_SLACK_NS)


async def serve(endpoint: str, host: str, frequency_hz: float) -> None:
    """Answer on the channel until killed."""
    process = UrRtdeProcess(host, frequency_hz)
    server = ChannelServer(
        endpoint,
        {
            Start: process.start,
            Watch: process.watch,
            Command: process.command,
            Upload: process.upload,
            Beat: process.beat,
            Beside: process.beside,
            Move: process.move,
            Reachable: process.reachable,
            Halt: process.halt,
        },
    )
    await server.serve()


def main() -> None:
    """Run the process; its arguments are the endpoint, the controller's host, the frequency and the parent's id."""
    endpoint, host, frequency_hz, parent = sys.argv[1:]
    end_with(int(parent))
    relax_timers()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    asyncio.run(serve(endpoint, host, float(frequency_hz)))


if __name__ == "__main__":
    main()
