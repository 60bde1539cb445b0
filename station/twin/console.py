"""The twin's console: faults switched on and off, and fruit laid in, while the twin runs.

One JSON object a line, answered by one, on a loopback port of its own. For example
`{"do": "set", "device": "camera", "fault": "off"}` is answered with `{"ok": true, "result": …}`, and what is wrong with
`{"ok": false, "error": "…"}`.
"""

import asyncio
import json
import socket
from collections.abc import Callable, Mapping
from typing import Any

from station.errors import BadInputError, StationError
from station.twin.faults import FaultBoard

LONGEST_LINE_BYTES = 4096
Action = Callable[[Mapping[str, Any]], Any]


class ConsoleError(StationError):
    """The console cannot be reached."""


class ConsoleRefusalError(BadInputError):
    """The console does not know the request, or refuses it."""


class ConsoleServer:
    """Serves the fault boards of all devices, and further actions by their names."""

    def __init__(self, boards: Mapping[str, FaultBoard], actions: Mapping[str, Action], host: str, port: int) -> None:
        self._boards = boards
        self._actions: dict[str, Action] = {
            "list": self._list,
            "known": self._known,
            "set": self._set,
            "clear": self._clear,
            **actions,
        }
        self._host, self._port = host, port
        self._server: asyncio.Server | None = None
        self._open: set[asyncio.StreamWriter] = set()

    @property
    def address(self) -> tuple[str, int]:
        """Host and port that the console listens on; the port is a free one where 0 was given."""
        if self._server is None:
            return self._host, self._port
        return self._server.sockets[0].getsockname()[:2]

    async def start(self) -> None:
        """Listen.

        Raises:
            OSError: the address is in use.
        """
        self._server = await asyncio.start_server(self._serve, self._host, self._port, limit=LONGEST_LINE_BYTES)

    async def stop(self) -> None:
        """Stop listening and cut the connections that are open."""
        if self._server is not None:
            self._server.close()
            for writer in self._open:
                writer.close()
            await self._server.wait_closed()
            self._server = None

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._open.add(writer)
        try:
            while line := await reader.readline():
                writer.write(json.dumps(self._answer(line)).encode() + b"\n")
                await writer.drain()
        except (ValueError, ConnectionError):
            return  # a line beyond the limit, or a peer that is gone: nobody is left to answer
        finally:
            self._open.discard(writer)
            writer.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            request = json.loads(line)
            action = self._actions[request["do"]]
        except (ValueError, TypeError, KeyError, RecursionError):
            return {"ok": False, "error": f'expected {{"do": one of {", ".join(self._actions)}, …}} on one line'}
        try:
            return {"ok": True, "result": action(request)}
        except (ValueError, TypeError, KeyError) as error:
            return {"ok": False, "error": str(error)}

    def _board(self, request: Mapping[str, Any]) -> FaultBoard:
        device = str(request.get("device"))
        if device not in self._boards:
            raise ValueError(f"there is no device {device!r}; there are: {', '.join(self._boards)}")
        return self._boards[device]

    def _list(self, _request: Mapping[str, Any]) -> dict[str, dict[str, float]]:
        return {device: board.snapshot() for device, board in self._boards.items()}

    def _known(self, request: Mapping[str, Any]) -> list[str]:
        return list(self._board(request).known)

    def _set(self, request: Mapping[str, Any]) -> dict[str, float]:
        amount = request.get("amount", 1.0)
        if isinstance(amount, bool) or not isinstance(amount, int | float):
            raise ValueError(f"amount: expected a number, found {amount!r}")  # noqa: TRY004 (one error for all)
        board = self._board(request)
        board.set(str(request.get("fault")), amount)
        return board.snapshot()

    def _clear(self, request: Mapping[str, Any]) -> dict[str, float]:
        fault = request.get("fault")
        board = self._board(request)
        board.clear(None if fault is None else str(fault))
        return board.snapshot()


def ask(host: str, port: int, request: Mapping[str, Any], timeout_s: float = 3.0) -> Any:
    """Send a running twin's console one request, `do` and what it needs; connection and answer have `timeout_s` each.

    Returns:
        The answer's result.

    Raises:
        ConsoleError: no twin answers there.
        ConsoleRefusalError: the console refuses the request; its text is the message.
    """
    try:
        with socket.create_connection((host, port), timeout_s) as connection, connection.makefile("rwb") as stream:
            stream.write(json.dumps(dict(request)).encode() + b"\n")
            stream.flush()
            line = stream.readline()
        answer = json.loads(line)
    except (OSError, ValueError) as error:
        raise ConsoleError(f"no twin answers at {host}:{port} ({error}); start it with: station twin") from error
    if not answer["ok"]:
        raise ConsoleRefusalError(answer["error"])
    return answer["result"]
