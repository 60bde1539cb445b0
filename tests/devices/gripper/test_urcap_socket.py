"""The URCap's socket as foreign clients use it."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

OnWire = Callable[..., Any]


async def exchange(rig: Any, *lines: str) -> list[bytes]:
    """Send lines on one connection, each after the answer to the one before."""
    reader, writer = await asyncio.open_connection(rig.server.host, rig.server.port)
    answers = []
    for line in lines:
        writer.write(line.encode())
        answers.append(await reader.read(100))
    writer.close()
    await writer.wait_closed()
    return answers


async def until_replied(rig: Any, line: str, reply: bytes) -> None:
    """Send it on a new connection each time until an answer comes; the scenario's own limit is the deadline."""
    while (await exchange(rig, line)) != [reply]:
        pass


@pytest.mark.parametrize(
    ("line", "reply"),
    [
        ("SET POS 100 SPE 255 FOR 0 GTO 1\n", b"ack"),
        ("SET GTO 0\n", b"ack"),
        ("GET STA\n", b"STA 3\n"),
        ("GET POS\n", b"POS 3\n"),
        ("GET FLT\n", b"FLT 0\n"),
        ("GET XYZ\n", b"?\n"),
        ("SET POS 256\n", b"?\n"),
        ("SET POS -1\n", b"?\n"),
        (f"SET POS {'1' * 5000}\n", b"?\n"),
        ("SET ACT 2\n", b"?\n"),
        ("SET POS\n", b"?\n"),
        ("SET\n", b"?\n"),
        ("\x00\xff\n", b"?\n"),
    ],
)
def test_each_line_gets_its_answer(on: OnWire, line: str, reply: bytes):
    async def scenario(rig: Any) -> list[bytes]:
        return await exchange(rig, line)

    assert on("urcap", scenario) == [reply]


def test_a_client_with_a_connection_for_each_command_grips(on: OnWire):
    async def scenario(rig: Any) -> None:
        assert await exchange(rig, "SET POS 40 SPE 255 FOR 255 GTO 1\n") == [b"ack"]
        assert await exchange(rig, "GET PRE\n") == [b"PRE 40\n"]
        await until_replied(rig, "GET OBJ\n", b"OBJ 3\n")
        assert await exchange(rig, "GET POS\n") == [b"POS 40\n"]

    on("urcap", scenario)


def test_the_object_state_is_0_when_the_acknowledgement_comes(on: OnWire):
    async def scenario(rig: Any) -> None:
        await exchange(rig, "SET POS 3 GTO 1\n")
        await until_replied(rig, "GET OBJ\n", b"OBJ 3\n")
        rig.clock.hold()  # on a busy machine the fingers may arrive between the two lines
        for position in range(100, 110):
            assert await exchange(rig, f"SET POS {position} SPE 0 GTO 1\n", "GET OBJ\n") == [b"ack", b"OBJ 0\n"]
            rig.clock.skip(10.0)
            assert await exchange(rig, "GET OBJ\n") == [b"OBJ 3\n"]

    on("urcap", scenario)


def test_two_clients_see_one_gripper(on: OnWire):
    async def scenario(rig: Any) -> None:
        first, second = await asyncio.gather(
            exchange(rig, "SET POS 77\n", "GET PRE\n"),
            exchange(rig, *["GET STA\n"] * 20),
        )
        assert first == [b"ack", b"PRE 77\n"]
        assert second == [b"STA 3\n"] * 20
        assert await exchange(rig, "GET PRE\n") == [b"PRE 77\n"]

    on("urcap", scenario)


def test_an_emergency_stop_is_a_question_mark(on: OnWire):
    async def scenario(rig: Any) -> list[bytes]:
        rig.faults.set("emergency_stopped")
        return await exchange(rig, "GET POS\n", "GET STA\n")

    assert on("urcap", scenario) == [b"POS ?\n", b"STA ?\n"]


def test_a_client_that_never_ends_its_line_is_dropped(on: OnWire):
    async def scenario(rig: Any) -> bytes:
        reader, writer = await asyncio.open_connection(rig.server.host, rig.server.port)
        writer.write(b"x" * 200_000)
        try:
            return await reader.read()
        except ConnectionError:
            return b""
        finally:
            writer.transport.abort()

    assert on("urcap", scenario) == b""
