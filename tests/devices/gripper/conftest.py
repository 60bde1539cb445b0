"""A twin gripper on each wire, with the station's driver in front of it."""

import asyncio
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import pytest

from station.devices.gripper.robotiq import Robotiq2F85, make_gripper
from station.settings.gripper import GripperSettings, ModbusRtuSettings, UrcapSettings
from station.twin.faults import FaultBoard
from station.twin.robotiq.faults import gripper_faults
from station.twin.robotiq.load import Load
from station.twin.robotiq.modbus import RtuOverTcpServer, RtuSerialServer
from station.twin.robotiq.model import RobotiqGripper as Twin
from station.twin.robotiq.registers import Command
from station.twin.robotiq.urcap import UrcapServer

SCENARIO_LIMIT_S = 30.0


class SkippingClock:
    """The machine's time, which a test can also run ahead, or hold: fingers then do what they do however busy it is."""

    def __init__(self) -> None:
        self._skipped_s = 0.0
        self._held_s: float | None = None

    def now_s(self) -> float:
        return (time.monotonic() if self._held_s is None else self._held_s) + self._skipped_s

    def skip(self, duration_s: float) -> None:
        self._skipped_s += duration_s

    def hold(self) -> None:
        """Let no time pass but what is skipped."""
        self._held_s = time.monotonic()

    def go_on(self) -> None:
        """Let it pass again, from where it was held."""
        assert self._held_s is not None
        self._skipped_s -= time.monotonic() - self._held_s
        self._held_s = None


class Server(Protocol):
    async def start(self) -> None: ...

    async def stop(self) -> None: ...


@dataclass
class Rig:
    """A twin that is activated and open, its server, and a driver."""

    wire: str
    settings: GripperSettings
    server: Server = field(init=False)
    clock: SkippingClock = field(default_factory=SkippingClock)
    faults: FaultBoard = field(default_factory=gripper_faults)
    twin: Twin = field(init=False)
    driver: Robotiq2F85 = field(init=False)

    def __post_init__(self) -> None:
        self.twin = Twin(self.clock, self.faults)
        self.twin.write(Command(activate=True))
        self.clock.skip(3.0)
        self.twin.status()
        self.server = {
            "urcap": lambda: UrcapServer(self.twin, port=0),
            "rtu over tcp": lambda: RtuOverTcpServer(self.twin, port=0),
            "serial": lambda: RtuSerialServer(self.twin),
        }[self.wire]()

    async def start(self) -> None:
        await self.server.start()
        match self.server:
            case UrcapServer(host=host, port=port):
                wire = {"urcap": UrcapSettings(host=host, port=port)}
            case RtuOverTcpServer(host=host, port=port):
                wire = {"driver": "modbus_rtu", "modbus_rtu": ModbusRtuSettings(line="tcp", host=host, port=port)}
            case RtuSerialServer(path=path):
                wire = {"driver": "modbus_rtu", "modbus_rtu": ModbusRtuSettings(line="serial", serial_port=path)}
            case _:
                raise AssertionError(self.server)
        self.settings = self.settings.model_copy(update=wire)
        self.driver = make_gripper(self.settings)

    def load(self, load: Load) -> None:
        self.twin.load = load

    async def activate(self) -> None:
        """Have the driver activate, without waiting for the fingers' travel."""
        activating = asyncio.create_task(self.driver.activate())
        await self.until(lambda: activating.done() or self.twin.status().state == 1)
        self.clock.skip(5.0)
        await activating

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait for a condition; the scenario's own limit is the deadline."""
        while not condition():
            await asyncio.sleep(0.005)


Scenario = Callable[[Rig], Awaitable[Any]]


def play(wire: str, scenario: Scenario, **settings: Any) -> Any:
    """Run a scenario against a fresh rig; nothing may go wrong behind its back."""
    unseen: list[dict[str, Any]] = []

    async def whole() -> Any:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: unseen.append(context))
        # Where no limit is to pass, none does on a busy machine either.
        rig = Rig(wire, GripperSettings(**dict[str, Any]({"answer_timeout_s": 2.0, "move_margin_s": 5.0, **settings})))
        await rig.start()
        try:
            async with asyncio.timeout(SCENARIO_LIMIT_S):
                return await scenario(rig)
        finally:
            await rig.driver.close()
            await rig.server.stop()

    result = asyncio.run(whole())
    assert not unseen
    return result


@pytest.fixture(params=["urcap", "rtu over tcp", "serial"])
def wire(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def on_wire(wire: str) -> Callable[..., Any]:
    """Run a scenario on each wire in turn."""
    return lambda scenario, **settings: play(wire, scenario, **settings)


@pytest.fixture
def on() -> Callable[..., Any]:
    """Run a scenario on one named wire."""
    return play
