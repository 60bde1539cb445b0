"""TCP proxy of one link: passes bytes on as they are, or disturbs them for a while."""

import asyncio
import contextlib
import random
import socket
import struct
import time
from collections.abc import Coroutine
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

_PIECE_BYTES = 2**18
"""Read at once: a camera's frame has 0.9 MB."""
_LONGEST_LATENCY_S = 0.2
_MOST_SINGLE_BYTES = 256
"""Of a segment that is split; the rest goes in pieces of an Ethernet frame, as a camera's frame has a million."""
_LONGEST_SPLIT_BYTES = 1460
_SEGMENTS = 3
"""So many segments are repeated or corrupted at most."""
_MOST_FLIPS, _MOST_GARBAGE_BYTES = 4, 16
_HEAD_BYTES = 64
"""Half of the corruptions are here, where most protocols have lengths and codes."""
_ABORT = struct.pack("ii", 1, 0)
"""Of SO_LINGER: a close sends RST."""


class Kind(StrEnum):
    """Kind of a link's disturbance."""

    DELAY = "delay"
    """Each segment is held back for up to 0.2 s."""
    STALL = "stall"
    """Nothing passes, then all that has gathered."""
    CUT_FIN = "cut (FIN)"
    """All connections are closed, and new ones are refused for a while."""
    CUT_RST = "cut (RST)"
    SPLIT = "split"
    """Segments of one byte, the rest of a long one in pieces of an Ethernet frame."""
    REPEAT = "repeat"
    """The next segments come twice."""
    CORRUPT = "corrupt"
    """The next segments have flipped bits, or garbage put in."""
    TRUNCATE = "truncate"
    """Half of the next segment comes, then RST."""


AT_ONCE = {Kind.REPEAT, Kind.CORRUPT, Kind.TRUNCATE}
"""Kinds that are over with some segments, however long they may wait for them."""
CUTS = {Kind.CUT_FIN, Kind.CUT_RST}


class Way(StrEnum):
    """Direction of the bytes that are disturbed."""

    TO_STATION = "to the station"
    FROM_STATION = "from the station"


class Route(NamedTuple):
    """One port of a link: the same number on both addresses."""

    host: str
    """Where the device listens."""
    port: int
    station_dials: bool = True
    """False where the station listens and the other side dials."""


@dataclass(slots=True)
class Disturbance:
    """One disturbance of one link.

    Args:
        kind: what is done.
        way: to which bytes; a cut concerns both ways.
        lasts_s: how long, or how long at most segments are waited for.
        chance: draws the details.
    """

    kind: Kind
    way: Way
    lasts_s: float
    chance: random.Random
    touched: int = 0
    """Segments that were changed or held back, and connections cut."""
    began_s: float = field(default_factory=time.monotonic)
    ended_s: float | None = None
    left: int = 0

    def __post_init__(self) -> None:
        """Draw how many segments are touched at most."""
        self.left = self.chance.randint(1, _SEGMENTS) if self.kind in AT_ONCE - {Kind.TRUNCATE} else 1

    @property
    def ends_s(self) -> float:
        """The monotonic time at which it is over at the latest."""
        return self.began_s + self.lasts_s


class _Cut(Exception):  # noqa: N818 (no error of the program's)
    """The connection ends here, by RST."""


class Link:
    """All connections of one link.

    Args:
        host: where the proxy listens.
        routes: the link's ports.
    """

    def __init__(self, host: str, routes: tuple[Route, ...]) -> None:
        self._host, self._routes = host, routes
        self._listeners: list[socket.socket] = []
        self._tasks: set[asyncio.Task[None]] = set()
        self._connections: dict[asyncio.Task[None], tuple[socket.socket, socket.socket]] = {}
        self._now: Disturbance | None = None

    async def open(self) -> None:
        """Listen on every port of the link."""
        for route in self._routes:
            listener = socket.create_server((self._host, route.port), backlog=64)
            listener.settimeout(0)
            self._listeners.append(listener)
            self._spawn(self._accept(listener, route))

    async def close(self) -> None:
        """Cut all, and listen no more. Idempotent."""
        for task in tuple(self._tasks):
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for listener in self._listeners:
            listener.close()
        self._listeners.clear()

    async def disturb(self, disturbance: Disturbance) -> None:
        """Disturb the link until it is over.

        Args:
            disturbance: begins now.
        """
        disturbance.began_s, self._now = time.monotonic(), disturbance
        try:
            if disturbance.kind in CUTS:
                self._cut_all(disturbance)
            while time.monotonic() < disturbance.ends_s and not (disturbance.kind in AT_ONCE and not disturbance.left):
                await asyncio.sleep(0.005)
        finally:
            self._now, disturbance.ended_s = None, time.monotonic()

    def _cut_all(self, disturbance: Disturbance) -> None:
        for task, both in tuple(self._connections.items()):
            disturbance.touched += 1
            if disturbance.kind is Kind.CUT_RST:
                task.cancel()
                continue
            for each in both:
                with contextlib.suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)

    def _spawn(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _accept(self, listener: socket.socket, route: Route) -> None:
        while True:
            near, _ = await asyncio.get_running_loop().sock_accept(listener)
            both = (near, socket.socket())
            task = self._spawn(self._connect(*both, route))
            self._connections[task] = both
            task.add_done_callback(lambda ended: self._connections.pop(ended, None))

    async def _connect(self, near: socket.socket, far: socket.socket, route: Route) -> None:
        """Carry one connection until either side ends it, or it is cut."""
        whole = False
        for each in (near, far):
            each.settimeout(0)
            each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        try:
            if self._now is not None and self._now.kind in CUTS:
                self._now.touched += 1
                return
            await asyncio.get_running_loop().sock_connect(far, (route.host, route.port))
            out, back = (
                (Way.FROM_STATION, Way.TO_STATION) if route.station_dials else (Way.TO_STATION, Way.FROM_STATION)
            )
            async with asyncio.TaskGroup() as group:
                group.create_task(self._carry(near, far, out))
                group.create_task(self._carry(far, near, back))
            whole = True
        except* (_Cut, OSError):
            pass  # both sides see the RST below
        finally:
            for each in (near, far):
                if not whole:
                    each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _ABORT)
                each.close()

    async def _carry(self, source: socket.socket, target: socket.socket, way: Way) -> None:
        loop = asyncio.get_running_loop()
        while data := await loop.sock_recv(source, _PIECE_BYTES):
            now = self._now
            if now is None or now.way is not way or now.kind in CUTS:
                await loop.sock_sendall(target, data)
            else:
                await self._disturbed(target, data, now)
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_WR)

    async def _disturbed(self, target: socket.socket, data: bytes, now: Disturbance) -> None:
        loop, kind, chance = asyncio.get_running_loop(), now.kind, now.chance
        if kind in AT_ONCE:
            if not now.left:
                await loop.sock_sendall(target, data)
                return
            now.left -= 1
        now.touched += 1
        if kind is Kind.DELAY:
            await asyncio.sleep(chance.uniform(0.0, _LONGEST_LATENCY_S))
            await loop.sock_sendall(target, data)
        elif kind is Kind.STALL:
            await asyncio.sleep(max(0.0, now.ends_s - time.monotonic()))
            await loop.sock_sendall(target, data)
        elif kind is Kind.SPLIT:
            for piece in split(data, chance):
                await loop.sock_sendall(target, piece)
                await asyncio.sleep(0)
        elif kind is Kind.REPEAT:
            await loop.sock_sendall(target, data + data)
        elif kind is Kind.CORRUPT:
            await loop.sock_sendall(target, corrupted(data, chance))
        else:
            await loop.sock_sendall(target, data[: len(data) // 2])
            raise _Cut


def split(data: bytes, chance: random.Random) -> list[bytes]:
    """Return the same bytes in small segments."""
    pieces = [data[at : at + 1] for at in range(min(len(data), _MOST_SINGLE_BYTES))]
    at = len(pieces)
    while at < len(data):
        size = chance.randint(1, _LONGEST_SPLIT_BYTES)
        pieces.append(data[at : at + size])
        at += size
    return pieces


def corrupted(data: bytes, chance: random.Random) -> bytes:
    """Return bytes with some bits flipped, or with garbage put in."""
    within = min(len(data), _HEAD_BYTES) if chance.random() < 0.5 else len(data)
    at = chance.randrange(within)
    if chance.random() < 0.25:
        return data[:at] + chance.randbytes(chance.randint(1, _MOST_GARBAGE_BYTES)) + data[at:]
    changed = bytearray(data)
    for _ in range(chance.randint(1, _MOST_FLIPS)):
        changed[chance.randrange(within)] ^= 1 << chance.randrange(8)
    return bytes(changed)
