"""The twin's console over its socket."""

import asyncio
import json
from collections.abc import Callable

import pytest

from station.twin.console import LONGEST_LINE_BYTES, ConsoleError, ConsoleRefusalError, ConsoleServer, ask
from station.twin.faults import FaultBoard


def with_console(check: Callable[[str, int, FaultBoard], None]) -> None:
    """Run a blocking check against a console that serves one device."""

    async def run() -> None:
        board = FaultBoard("camera", ("fogged",))
        console = ConsoleServer({"camera": board}, {"echo": lambda request: request["word"]}, "127.0.0.1", 0)
        await console.start()
        try:
            await asyncio.to_thread(check, *console.address, board)
        finally:
            await console.stop()
            await asyncio.get_running_loop().shutdown_default_executor()

    asyncio.run(run())


def test_faults_are_set_listed_and_cleared():
    def check(host: str, port: int, board: FaultBoard) -> None:
        assert ask(host, port, {"do": "set", "device": "camera", "fault": "delayed", "amount": 0.5}) == {"delayed": 0.5}
        ask(host, port, {"do": "set", "device": "camera", "fault": "fogged"})
        assert board.amount("delayed") == 0.5
        assert ask(host, port, {"do": "known", "device": "camera"}) == list(board.known)
        assert ask(host, port, {"do": "list"}) == {"camera": {"delayed": 0.5, "fogged": 1.0}}
        ask(host, port, {"do": "clear", "device": "camera", "fault": "delayed"})
        assert board.snapshot() == {"fogged": 1.0}
        ask(host, port, {"do": "clear", "device": "camera"})
        assert board.snapshot() == {}

    with_console(check)


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"do": "set", "device": "oven", "fault": "off"}, "there is no device 'oven'; there are: camera"),
        ({"do": "set", "device": "camera", "fault": "hot"}, "camera has no fault 'hot'; it knows: off, stuck"),
        ({"do": "set", "device": "camera", "fault": "off", "amount": True}, "amount: expected a number, found True"),
        ({"do": "set", "device": "camera", "fault": "off", "amount": float("nan")}, "expected a number from 0 to 1000"),
        ({"do": "set", "device": "camera", "fault": "off", "amount": -1}, "expected a number from 0 to 1000"),
        ({"do": "set", "device": "camera", "fault": "off", "amount": 10**400}, "expected a number from 0 to 1000"),
        ({"do": "clear", "device": "camera", "fault": "hot"}, "camera has no fault 'hot'"),
        ({"do": "brew"}, "one of list, known, set, clear, echo"),
        ({"do": ["set"]}, "one of list, known, set, clear, echo"),
        ({"do": "echo"}, "word"),
    ],
)
def test_what_is_wrong_is_refused_with_what_there_is(order, words):
    def check(host: str, port: int, board: FaultBoard) -> None:
        with pytest.raises(ConsoleRefusalError, match=words):
            ask(host, port, order)
        assert board.snapshot() == {}
        assert ask(host, port, {"do": "echo", "word": "still here"}) == "still here"

    with_console(check)


@pytest.mark.parametrize(
    "line", [b"[]\n", b"\xff\xfe\n", b"nonsense\n", b"{}\n", b"[" * 4000 + b"\n", b"x" * 2 * LONGEST_LINE_BYTES + b"\n"]
)
def test_garbage_never_stops_the_console(line):
    async def run() -> None:
        console = ConsoleServer({}, {}, "127.0.0.1", 0)
        await console.start()
        reader, writer = await asyncio.open_connection(*console.address)
        writer.write(line)
        answer = await asyncio.wait_for(reader.readline(), 5)
        assert not answer or not json.loads(answer)["ok"]
        writer.close()
        other, again = await asyncio.open_connection(*console.address)
        again.write(b'{"do": "list"}\n')
        assert json.loads(await asyncio.wait_for(other.readline(), 5)) == {"ok": True, "result": {}}
        again.close()
        await console.stop()

    asyncio.run(run())


def test_without_a_twin_the_remedy_is_named(unused_port):
    with pytest.raises(ConsoleError, match="start it with: station twin"):
        ask("127.0.0.1", unused_port, {"do": "list"})
