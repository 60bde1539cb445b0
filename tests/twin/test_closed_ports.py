"""A device of the twin that is gone answers no client, also not one that it was just accepting."""

import asyncio
import contextlib
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest

from station.twin.clock import SteadyClock
from station.twin.digit.sensor import DigitSensor
from station.twin.digit.server import DigitCameraServer, digit_faults
from station.twin.digit.wire import packed
from station.twin.ports import stop_listening
from station.twin.robotiq.faults import gripper_faults
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.urcap import UrcapServer
from station.twin.ur import dashboard, primary, rtde
from station.twin.ur.controller import UrController, arm_faults
from station.twin.world import World
from tests.hosts import fresh_host

TURNS_UNTIL_SERVED = 8
"""Turns of asyncio's loop in which a client that connected is served for certain, while its port is open."""


def gripper(host: str) -> UrcapServer:
    return UrcapServer(RobotiqGripper(SteadyClock(), gripper_faults()), host=host, port=0)


def camera(host: str) -> DigitCameraServer:
    return DigitCameraServer(World(SteadyClock()), DigitSensor(1), SteadyClock(), digit_faults(), host=host)


def arm(host: str) -> UrController:
    return UrController(host, SteadyClock(), arm_faults())


@dataclass(frozen=True)
class Port:
    """A port of a device, the request to it (empty where it sends by itself), and a part of its answer."""

    device: Callable[[str], Any]
    number: Callable[[Any], int]
    request: bytes
    answer: bytes


PORTS = {
    "gripper": Port(gripper, lambda server: server.port, b"GET STA\n", b"STA 0"),
    "camera": Port(camera, lambda server: server.port, packed("leds", red=1, green=1, blue=1), b"leds"),
    "dashboard": Port(arm, lambda _: dashboard.PORT, b"robotmode\n", b"Robotmode"),
    "primary": Port(arm, lambda _: primary.PORT, b"", b"UR"),
    "rtde": Port(arm, lambda _: rtde.PORT, bytes((0, 5, 86, 0, 2)), bytes((0, 4, 86, 1))),
}


async def answer_of(client: socket.socket, request: bytes, expected: bytes) -> bytes:
    """Send a request; return what comes back until `expected` does or the connection ends: one of both within 10 s."""
    answer = b""
    async with asyncio.timeout(10):
        with contextlib.suppress(OSError):
            client.send(request)
            while part := await asyncio.get_running_loop().sock_recv(client, 4096):
                answer += part
                if expected in answer:
                    break
    return answer


@pytest.mark.parametrize("turns", [*range(TURNS_UNTIL_SERVED), None])
@pytest.mark.parametrize("port", PORTS.values(), ids=PORTS.keys())
def test_nobody_is_served_after_a_port_was_closed(port: Port, turns: int | None):
    """`turns` after a client has connected; without a number it stays open, and the same request has its answer."""
    host = fresh_host()

    async def scenario() -> bytes:
        device = port.device(host)
        await device.start()
        try:
            with socket.create_connection((host, port.number(device))) as client:
                client.setblocking(False)
                if turns is None:
                    return await answer_of(client, port.request, port.answer)
                for _ in range(turns):
                    await asyncio.sleep(0)
                await device.stop()
                with contextlib.suppress(OSError):
                    client.recv(4096)
                return await answer_of(client, port.request, port.answer)
        finally:
            await device.stop()

    answer = asyncio.run(scenario())
    assert port.answer in answer if turns is None else answer == b""


def test_a_port_is_closed_also_where_its_closing_is_cut_short():
    """As the end of the twin does it to a device that is just going away."""

    async def scenario() -> bool:
        server = await asyncio.start_server(lambda _reader, writer: writer.close(), "127.0.0.1", 0)
        closing = asyncio.create_task(stop_listening(server))
        await asyncio.sleep(0)
        closing.cancel()
        await asyncio.gather(closing, return_exceptions=True)
        return server.is_serving()

    assert not asyncio.run(scenario())
