"""The station's CAN driver in front of the twin's nodes, on a real bus of python-can."""

import asyncio
import itertools
import os
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any

import can
import pytest

from plc_interface.outputs.can.line_io import LineIo
from station.settings.can import CanSettings
from station.twin.can.faults import line_faults
from station.twin.can.line import LineNodes
from station.twin.clock import SteadyClock
from station.twin.faults import CommonFault, FaultBoard

SCENARIO_LIMIT_S = 40.0
GROUP = "239.74.163.2"
_NUMBERS = itertools.count(1)

PATIENT: dict[str, Any] = {
    "enabled": True,
    "heartbeat_s": 0.05,
    "heartbeat_lost_s": 1.0,
    "answer_timeout_s": 2.0,
    "retry_s": 0.05,
    "count_stale_s": 1.0,
    "tolerance_counts": 1_000_000,
    "echo_deadline_s": 1.0,
}
"""Times for a machine whose cores are all busy."""


@dataclass
class Rig:
    """The nodes, the driver, and a bus that listens."""

    settings: CanSettings
    first_count: int = 0
    faults: FaultBoard = field(default_factory=line_faults)
    nodes: LineNodes = field(init=False)
    io: LineIo = field(init=False)

    def __post_init__(self) -> None:
        self.nodes = LineNodes(self.settings, SteadyClock(), self.faults, self.first_count)
        self.io = LineIo(self.settings)

    async def until(self, condition: Callable[[], object]) -> None:
        """Wait for a condition; the scenario's own limit is the deadline."""
        while not condition():
            await asyncio.sleep(0.005)

    async def ready(self) -> None:
        self.io.renew_health(SCENARIO_LIMIT_S)
        await self.until(lambda: self.io.ready)

    async def order(self, sequence: int, ahead: int, lane: int = 1) -> asyncio.Task[Any]:
        """Order a shot on a belt that does not move, and wait until the gate has it or refused it."""
        self.faults.set(CommonFault.STUCK)
        at_count = (self.nodes.encoder.count + ahead) % 2**32
        await self.until(lambda: self.io.encoder_count() == self.nodes.encoder.count)
        shot = asyncio.create_task(self.io.divert(sequence, lane, at_count))
        armed = self.nodes.gate._armed
        await self.until(lambda: shot.done() or sequence % 65536 in armed)
        return shot

    def run_belt(self) -> None:
        self.faults.clear(CommonFault.STUCK)

    def wire(self) -> can.BusABC:
        """A connection of the test's own; the caller shuts it down."""
        return can.Bus(interface="virtual", channel=self.settings.channel, ignore_config=True)


Scenario = Callable[[Rig], Awaitable[Any]]


def play(scenario: Scenario, *, first_count: int = 0, start: bool = True, **settings: Any) -> Any:
    """Run a scenario against a fresh rig; nothing may go wrong behind its back."""
    unseen: list[dict[str, Any]] = []
    bus = {"interface": "virtual", "channel": f"test {os.getpid()} {next(_NUMBERS)}"}

    async def whole() -> Any:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: unseen.append(context))
        rig = Rig(CanSettings(**dict[str, Any]({**bus, **PATIENT, **settings})), first_count)
        await rig.nodes.start()
        if start:
            await rig.io.start()
        try:
            async with asyncio.timeout(SCENARIO_LIMIT_S):
                return await scenario(rig)
        finally:
            await rig.io.stop()
            await rig.nodes.stop()

    result = asyncio.run(whole())
    assert not unseen
    return result


@pytest.fixture
def on_bus() -> Callable[..., Any]:
    """Run a scenario on a virtual bus of its own."""
    return play


@pytest.fixture
def patient() -> dict[str, Any]:
    return dict(PATIENT)


@pytest.fixture
def multicast_port(unused_port: int) -> int:
    """A port on which frames by multicast pass from one socket of this machine to another."""
    options: dict[str, Any] = {"interface": "udp_multicast", "channel": GROUP, "port": unused_port, "hop_limit": 0}
    try:
        with can.Bus(ignore_config=True, **options) as one, can.Bus(ignore_config=True, **options) as other:
            one.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
            deadline_s = time.monotonic() + 5.0
            while time.monotonic() < deadline_s:
                message = other.recv(0.5)
                if message and message.arbitration_id == 0x7FF:
                    break
            else:
                pytest.skip("this machine passes no multicast between its own processes")
    except can.CanError as error:
        pytest.skip(f"this machine has no multicast: {error.__cause__ or error}")
    return unused_port
