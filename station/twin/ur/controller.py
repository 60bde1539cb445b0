"""The whole controller: its cycle of 2 ms, its servers, and the faults that can be switched on in it."""

import asyncio
import contextlib
import logging
from typing import Any, Literal

from station.twin.clock import Clock
from station.twin.faults import CommonFault, FaultBoard
from station.twin.ur.body import Body
from station.twin.ur.dashboard import Dashboard
from station.twin.ur.inputs_outputs import InputsOutputs
from station.twin.ur.kinematics import JOINT_RANGE_RAD, Joints
from station.twin.ur.network import Network
from station.twin.ur.outputs import output_table
from station.twin.ur.registers import Registers
from station.twin.ur.rtde import FREQUENCY_HZ
from station.twin.ur.safety import Safety
from station.twin.ur.script import ControlScript

CYCLE_S = 1.0 / FREQUENCY_HZ
_STOOD_STILL_S = 0.1
"""A real controller is never so late; this one is, on a busy machine."""
LATE_CYCLES = 10
START_POSE_RAD: Joints = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)

OWN_FAULTS = (
    "protective_stop",
    "safeguard",
    "emergency_stop",
    "local_mode",
    "pendant_stop",
    "registers_in_use",
    "silent",
    "rtde_silent",
    "link_cut",
    "safety_fault",
)

log = logging.getLogger(__name__)


def arm_faults() -> FaultBoard:
    """A board with every fault that the controller knows."""
    return FaultBoard("arm", OWN_FAULTS)


class UrController:
    """A UR10e with its controller on one loopback address, on the ports that a real one has.

    Faults, and what their amount means:
        off: without power: connections cut and refused; afterwards the controller has started anew, the arm unpowered.
        stuck: alive, but packages repeat and nothing moves.
        garbage: RTDE packages and dashboard answers are noise.
        wrong: `actual_q` is off by the amount, rad, in every joint.
        slow: the arm moves at 1 / (1 + amount) of its speed.
        delayed: everything that is sent comes later by the amount, s.
        intermittent: every amount of seconds all connections are cut; new ones are taken.
        protective_stop: switching it on is the event; it stays until it is unlocked.
        safeguard: the guard is open as long as it is on: the program is paused, and continues its motion afterwards.
        emergency_stop: the button is pressed as long as it is on.
        local_mode: local control as long as it is on; script and primary connections drop.
        pendant_stop: switching it on stops the program.
        registers_in_use: a fieldbus holds input registers 0 to 23 against new clients.
        silent: connections are accepted, and nothing is ever sent.
        rtde_silent: the same on the RTDE port alone.
        link_cut: connections are cut and refused; the controller itself goes on.
        safety_fault: switching it on is the event; it stays until the safety system is restarted.
    """

    def __init__(
        self,
        host: str,
        clock: Clock,
        faults: FaultBoard,
        *,
        polyscope: Literal["5.22", "5.25"] = "5.22",
        joints_rad: Joints = START_POSE_RAD,
        joint_range_rad: float = JOINT_RANGE_RAD,
        running: bool = True,
    ) -> None:
        """Prepare a controller.

        Args:
            host: any 127.0.0.N; the ports are the real ones.
            clock: what moves the arm.
            faults: from `arm_faults`.
            polyscope: the PolyScope version that the controller reports.
            joints_rad: the joints' first positions, rad.
            joint_range_rad: how far the safety configuration lets each joint turn either way.
            running: powered and released from the start.
        """
        self.host, self.clock, self.faults = host, clock, faults
        self.polyscope: tuple[int, int] = (5, int(polyscope.split(".")[1]))
        self.version: tuple[int, int, int, int] = (*self.polyscope, 0, 1202319)
        self.version_text = ".".join(map(str, self.version))
        self.serial_number = "20245500001"
        self.speed_slider = 1.0
        self.network = Network(self)
        self._tick = 0
        self._timer: asyncio.Handle | None = None
        self._due_s = 0.0
        self._known_faults: set[str] = set()
        self._cut_at_s = 0.0
        self._switching: asyncio.Task[None] | None = None
        self._joint_range_rad = joint_range_rad
        self._boot(joints_rad, running=running)

    def _boot(self, joints_rad: Joints, *, running: bool) -> None:
        self._booted_at_s = self.clock.now_s()
        self.body = Body(joints_rad, self._booted_at_s, self._joint_range_rad)
        self.registers = Registers()
        self.inputs_outputs = InputsOutputs()
        self.safety = Safety(running=running)
        self.script = ControlScript(self.body, self.registers, self.safety)
        # The table's getters are bound to the objects above, and are replaced with them.
        self.outputs = output_table(self)
        self._dashboard = Dashboard(self)

    def answer(self, line: str) -> str:
        """Return the dashboard's answer to one line."""
        return self._dashboard.answer(line)

    @property
    def joints_rad(self) -> Joints:
        """Positions of the joints, rad."""
        return self.body.joints_rad

    @property
    def uptime_s(self) -> float:
        """RTDE `timestamp`."""
        return self.clock.now_s() - self._booted_at_s

    @property
    def timestamp_us(self) -> int:
        """The primary stream's timestamp."""
        return int(self.uptime_s * 1e6)

    @property
    def speed_scaling(self) -> float:
        """The share of the commanded speed at which the arm really moves."""
        return self.speed_slider / (1.0 + max(0.0, self.faults.amount(CommonFault.SLOW)))

    def measured_joints_rad(self) -> tuple[float, ...]:
        """RTDE `actual_q`."""
        error = self.faults.amount(CommonFault.WRONG)
        return tuple(q + error for q in self.body.joints_rad) if error else self.body.joints_rad

    def write_inputs(self, values: list[tuple[str, Any]]) -> None:
        """Take a client's package of inputs."""
        if self.faults.active(CommonFault.STUCK):
            return
        now_s = self.clock.now_s()
        for name, value in values:
            self.registers.write(name, value, now_s)
        written = dict(values)
        if written.get("speed_slider_mask"):
            self.speed_slider = min(max(0.0, written.get("speed_slider_fraction", 1.0)), 1.0)
        self.inputs_outputs.write(written)

    async def start(self) -> None:
        """Open the ports and start the cycle.

        Raises:
            OSError: one of the ports is taken.
        """
        await self.network.open()
        loop = asyncio.get_running_loop()
        self._due_s = loop.time()
        self._timer = loop.call_soon(self._cycle)

    async def stop(self) -> None:
        """Cut every connection and close the ports; the controller may be started again."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._switching is not None:
            # A switch under way would open the ports again after they are closed.
            await self._switching
        await self.network.close()

    def _cycle(self) -> None:
        loop = asyncio.get_running_loop()
        self._due_s += CYCLE_S
        late_s = loop.time() - self._due_s
        # Up to `LATE_CYCLES` are made up for in a row, so that clients get their 500 packages a second; more are lost.
        if late_s > LATE_CYCLES * CYCLE_S:
            self._due_s = loop.time()
        if late_s > _STOOD_STILL_S:
            self.script.stood_still(self.clock.now_s())
        # Before the cycle's work: an error in it does not end the controller.
        self._timer = loop.call_at(self._due_s, self._cycle)
        now_s = self.clock.now_s()
        self._apply_faults(now_s)
        if not self.faults.active(CommonFault.STUCK):
            self.safety.advance(now_s)
            self.body.advance(now_s, self.speed_scaling)
            # Last, so that the script sees an arrival or a stop in the cycle in which it happens.
            self.script.step(now_s)
        self._tick += 1
        for connection in list(self.network.connections):
            try:
                connection.publish(self._tick, now_s)
            except Exception:  # one client's package must not cost the others theirs
                log.exception("a client of the RTDE server is cut")
                connection.cut()

    def _apply_faults(self, now_s: float) -> None:
        period_s = self.faults.amount(CommonFault.INTERMITTENT)
        if period_s and now_s - self._cut_at_s > period_s:
            self._cut_at_s = now_s
            self.network.cut()
        if self._switching is not None and self._switching.done():
            self._switching = None
        # The ports are being opened or closed; what is switched meanwhile is taken afterwards.
        if self._switching is not None:
            return
        faults, begun = self.faults.snapshot().keys(), self.faults.take_new()
        # A fault that was switched on and off between two cycles has begun and ended in this one.
        ended = (self._known_faults | begun) - faults
        if not begun and not ended:
            return
        self._known_faults = set(faults)
        if CommonFault.OFF in ended:
            self._boot(self.body.joints_rad, running=False)
            begun |= faults & {"emergency_stop"}  # the button is still pressed where the controller starts
        self._begin_faults(begun, now_s)
        if "emergency_stop" in ended:
            self.safety.release_emergency_stop()
        if "local_mode" in begun | ended:
            self.network.cut_programmers()
        reachable = {CommonFault.OFF, "link_cut"}
        if (begun | ended) & reachable:
            self._switching = asyncio.create_task(self._switch_network(on=not faults & reachable))
        self.safety.remote, self.safety.guard_open = "local_mode" not in faults, "safeguard" in faults

    def _begin_faults(self, begun: frozenset[str], now_s: float) -> None:
        if "protective_stop" in begun:
            self.safety.stop_protectively(now_s)
        if "emergency_stop" in begun:
            self.safety.press_emergency_stop()
        if "safety_fault" in begun:
            self.safety.fail()
        if "pendant_stop" in begun:
            self.script.end("a person stopped the program on the pendant")
        if CommonFault.OFF in begun:
            self.safety.power_off()

    async def _switch_network(self, *, on: bool) -> None:
        # Also before an opening: a fault that was on for less than a cycle still cuts every connection.
        await self.network.close()
        if on:
            with contextlib.suppress(OSError):
                await self.network.open()
