"""The whole twin: arm, gripper, sensor, fruit and line on one loop, wired to each other as on the real cell."""

import asyncio
import signal
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal, Protocol

import cv2
import numpy as np

from station.errors import BadInputError
from station.memory import keep_freed_memory
from station.settings.arm import ArmPoses, ArmSettings
from station.settings.camera import TwinCameraSettings
from station.settings.can import CanSettings
from station.settings.gripper import GripperSettings
from station.supervision.notify import feed_watchdog, notify
from station.twin.can.faults import line_faults
from station.twin.can.line import LineNodes
from station.twin.clock import Clock, SteadyClock
from station.twin.console import Action, ConsoleServer
from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, Pose
from station.twin.damage import DAMAGES, Severity
from station.twin.digit.sensor import DigitSensor
from station.twin.digit.server import DigitCameraServer, digit_faults
from station.twin.faults import FaultBoard
from station.twin.fruit import Kind, draw_fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.robotiq.faults import gripper_faults
from station.twin.robotiq.modbus import RtuOverTcpServer
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.urcap import UrcapServer
from station.twin.ur.controller import UrController, arm_faults
from station.twin.ur.kinematics import Joints, forward
from station.twin.ur.poses import inverse_transform
from station.twin.world import World

LOOPBACK = "127.0.0.1"
CONSOLE_PORT = 49211
_AT_NEST_MM = 10.0
_IMAGE_RIGHT, _IMAGE_DOWN = 0, 2
"""The tool's axes, x and z, along which the sensor is mounted: to the right and down in its image. The fingers close
along y."""
_FURTHEST_MM = 6.0
"""From the gel's middle, where a fruit may be laid; the gel ends there."""
_BALL_HOLDER_MM = 18.0
"""The paper (Computers and Electronics in Agriculture 235 (2025) 110397) sees the 24 mm ball from 42 mm of width on: we
take the rest for what holds it."""


class _Server(Protocol):
    async def start(self) -> None: ...

    async def stop(self) -> None: ...


@dataclass(frozen=True, slots=True)
class TwinOptions:
    """Options of the twin, and its addresses: those where the station's settings have the devices."""

    fruit: Kind = Kind.STRAWBERRY
    seed: int = 1
    """Of the fruit, and of the sensor's noise and drift."""
    mm_per_px: float = MM_PER_PX
    """The sensor's scale."""
    bench: bool = False
    """No arm: the fingers are always where the fruit lies."""
    arm: ArmSettings = field(default_factory=ArmSettings)
    """Address at which the station connects to the arm, and the nest's pose."""
    can: CanSettings = field(default_factory=CanSettings)
    """Bus of the reject gate and the encoder; neither is there unless it is enabled."""
    gripper: GripperSettings = field(default_factory=GripperSettings)
    camera: TwinCameraSettings = field(default_factory=TwinCameraSettings)
    console_port: int = CONSOLE_PORT
    """On the loopback; 0 for any that is free."""
    polyscope: Literal["5.22", "5.25"] = "5.22"


class Twin:
    """The simulated cell."""

    def __init__(self, options: TwinOptions, clock: Clock | None = None) -> None:
        """Wire the cell, by the machine's time without a `clock`; nothing listens before `start`."""
        clock = clock or SteadyClock()
        self.boards: dict[str, FaultBoard] = {"camera": digit_faults(), "gripper": gripper_faults()}
        self.world = World(clock, Gel(mm_per_px=options.mm_per_px))
        self._mm_per_px = options.mm_per_px
        self.gripper = RobotiqGripper(clock, self.boards["gripper"], self.world)
        self.world.opening_mm = lambda: self.gripper.opening_mm(clock.now_s())
        self.camera = DigitCameraServer(
            self.world,
            DigitSensor(options.seed, mm_per_px=options.mm_per_px),
            clock,
            self.boards["camera"],
            host=options.camera.host,
            port=options.camera.port,
        )
        self._servers: list[_Server] = [
            self.camera,
            UrcapServer(self.gripper, options.gripper.urcap.host, options.gripper.urcap.port),
            RtuOverTcpServer(self.gripper, options.gripper.modbus_rtu.host, options.gripper.modbus_rtu.port),
        ]
        self._arm: UrController | None = None
        if not options.bench:
            self.boards["arm"] = arm_faults()
            arm = UrController(options.arm.host, clock, self.boards["arm"], polyscope=options.polyscope)
            self.world.sensor_mm = _beside_nest(arm, options.arm.poses)
            self._arm = arm
            self._servers.append(arm)
        actions: dict[str, Action] = {"fruit": self._lay, "remove": self._remove, "state": self._state}
        if options.can.enabled:
            self.boards["line"] = line_faults()
            line = LineNodes(options.can, clock, self.boards["line"])
            self._servers.append(line)
            actions["line"] = lambda _request: line.state()
        self.console = ConsoleServer(
            self.boards,
            actions,
            LOOPBACK,
            options.console_port,
        )
        self._servers.append(self.console)
        self._started: list[_Server] = []
        self._lay({"kind": options.fruit, "seed": options.seed})

    async def start(self) -> None:
        """Listen on every port.

        Raises:
            BadInputError: an address is in use or not this machine's; nothing listens then.
        """
        for server in self._servers:
            try:
                await server.start()
            except OSError as error:
                await self.stop()
                raise BadInputError(
                    f"the twin cannot listen: {error}; is another twin running? Stop it, or choose other addresses"
                ) from error
            self._started.append(server)

    async def stop(self) -> None:
        """Close every port and connection."""
        while self._started:
            await self._started.pop().stop()

    def _lay(self, request: Mapping[str, Any]) -> str:
        """Lay a fruit into the nest in the place of what was there."""
        kind, seed = request.get("kind"), request.get("seed", 1)
        # A list: in Python 3.11 `in Kind` raises TypeError for every plain string, also for a member's value.
        if kind not in list(Kind):
            raise ValueError(f"kind: expected one of {', '.join(Kind)}, found {kind!r}")
        if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
            raise ValueError(f"seed: expected a whole number from 0 to {2**31 - 1}, found {seed!r}")
        bruised = request.get("bruised", False)
        if not isinstance(bruised, bool):
            raise ValueError(f"bruised: expected true or false, found {bruised!r}")  # noqa: TRY004 (one error for all)
        severity = request.get("severity", Severity.SEVERE)
        if severity not in list(Severity):
            raise ValueError(f"severity: expected one of {', '.join(Severity)}, found {severity!r}")
        places = [request.get(axis, 0.0) for axis in ("x_mm", "y_mm")]
        if not all(isinstance(mm, int | float) and abs(mm) <= _FURTHEST_MM for mm in places):
            raise ValueError(f"x_mm, y_mm: expected numbers from -{_FURTHEST_MM:g} to {_FURTHEST_MM:g}, found {places}")
        x_px, y_px = (
            middle + mm / self._mm_per_px for middle, mm in zip((MIDDLE_X_PX, MIDDLE_Y_PX), places, strict=True)
        )
        fruit = draw_fruit(Kind(kind), seed, bruised=bruised, damage=DAMAGES[Severity(severity)])
        holder_mm = _BALL_HOLDER_MM if kind == Kind.RUBBER_BALL else 0.0
        self.world.place(fruit, Pose(x_px, y_px), holder_mm)
        return f"{kind} {seed}, {fruit.width_mm:.1f} mm wide"

    def _remove(self, _request: Mapping[str, Any]) -> None:
        self.world.remove()

    def _state(self, _request: Mapping[str, Any]) -> dict[str, Any]:
        squeezed = self.world.squeezed()
        return {
            "fruit_width_mm": self.world.fruit.width_mm if self.world.fruit else None,
            "fruit_length_mm": self.world.fruit.length_mm if self.world.fruit else None,
            "width_mm": self.world.width_mm(self.world.opening_mm()),
            "closing_mm": max(0.0, squeezed.closing_mm),
            "force_n": squeezed.force_n,
            "arm_rad": None if self._arm is None else list(self._arm.joints_rad),
        }


def _beside_nest(arm: UrController, poses: ArmPoses) -> Callable[[], tuple[float, float] | None]:
    """Return a function for the sensor's way from its place at the nest, mm in its image; None if it is elsewhere."""
    to_nest = inverse_transform(forward(poses.nest))

    @lru_cache(maxsize=1)  # called many times a cycle, and mostly the arm does not move
    def beside(joints_rad: Joints) -> tuple[float, float] | None:
        way_mm = 1000 * (to_nest @ forward(joints_rad))[:3, 3]
        if np.linalg.norm(way_mm) >= _AT_NEST_MM:
            return None
        return float(way_mm[_IMAGE_RIGHT]), float(way_mm[_IMAGE_DOWN])

    return lambda: beside(arm.joints_rad)


async def run(options: TwinOptions, on_started: Callable[[Twin], None]) -> None:
    """Run the twin until SIGINT or SIGTERM; `on_started` is called once every port is open.

    Raises:
        BadInputError: an address cannot be had.
    """
    keep_freed_memory()
    cv2.setNumThreads(1)  # waking a second one for each part of a frame costs more than it does
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    twin = Twin(options)
    await twin.start()
    feeding = asyncio.create_task(feed_watchdog(lambda: True))
    try:
        on_started(twin)
        notify("READY=1")
        await ended.wait()
    finally:
        feeding.cancel()
        await twin.stop()
