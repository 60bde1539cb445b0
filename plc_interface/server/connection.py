"""One client's connection: bytes in, responses out, in order."""

import asyncio
from typing import cast

from plc_interface.server.connection_manager import ConnectionManager
from plc_interface.server.exceptions import MalformedFrameError, Trouble
from plc_interface.server.mbap import LONGEST_FRAME, framed, frames
from plc_interface.server.peer import Peer

_BUFFER_BYTES = 4 * LONGEST_FRAME
"""Taken from the kernel at one time. What a client sends beyond it waits there, so that others have their turn."""
REQUESTS_PER_S = 1000
"""Permitted rate of one connection; a PLC needs a few requests for each scan. An estimate.

Without it the busiest client would take the whole core, at real-time priority, from the station and its pages.
"""
AT_ONCE_S = 0.25
"""How much of that rate may come as one burst, s. An estimate."""


class Connection(asyncio.BufferedProtocol):
    """Answers one client's requests where their bytes arrive, without a task or an await between."""

    _transport: asyncio.Transport
    """Set once it is connected."""

    def __init__(self, manager: ConnectionManager) -> None:
        self._manager = manager
        self._buffer = bytearray(_BUFFER_BYTES)
        self._view = memoryview(self._buffer)
        self._filled = 0
        self._ended = False
        self._spent_until_s = 0.0
        """Time by which the requests so far are due at the permitted rate."""
        self._waiting: asyncio.TimerHandle | None = None
        """Until the next requests may be read."""
        self.peer: Peer | None = None
        """None before it is connected, and where it was not admitted."""
        self.heard_s = 0.0
        """When the last complete request came."""
        self.unfinished_since_s: float | None = None
        """Since when a request is incomplete."""
        self.stalled_since_s: float | None = None
        """Since when the client does not take its responses."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Admit the client, or close the connection."""
        self._transport = cast("asyncio.Transport", transport)
        self.heard_s = self._manager.now_s()
        self.peer = self._manager.admit(self, self._transport)
        if self.peer is None:
            self.drop()

    def connection_lost(self, exc: Exception | None) -> None:
        """Handle the end of the connection."""
        self._end(f"its connection was lost: {exc}" if exc else "it has disconnected")

    def drop(self, trouble: Trouble | None = None, why: str = "") -> None:
        """Close the connection at once; count and log the trouble, if any, with one sentence why."""
        if self._ended:
            return
        if trouble is not None:
            self._manager.note(trouble, self.peer, f"{why}: its connection is closed")
        self._end("")
        # A client that does not take its responses would keep an orderly close waiting.
        if self._transport.is_closing() or self._transport.get_write_buffer_size() > 0:
            self._transport.abort()
        else:
            self._transport.close()

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return the buffer for the next bytes."""
        # Never empty: what is unfinished is less than one of the four ADUs that fit.
        return self._view[self._filled :]

    def buffer_updated(self, nbytes: int) -> None:
        """Answer every complete request."""
        if self._ended:
            return
        manager, peer = self._manager, cast("Peer", self.peer)
        size = self._filled + nbytes
        used = 0
        answers: list[bytes] = []
        malformed = ""
        now_s = manager.now_s()
        try:
            for (transaction, unit, message), end in frames(self._buffer, size):
                used = end
                self.heard_s = now_s
                answers.append(framed(transaction, unit, manager.answer(peer, unit, message)))
        except MalformedFrameError as error:
            malformed = str(error)
        if answers and not self._ended:
            self._transport.write(b"".join(answers))
        if malformed:
            self.drop(Trouble.MALFORMED_FRAME, malformed)
            return
        self._keep(used, size)
        self._spend(len(answers), now_s)

    def _spend(self, requests: int, now_s: float) -> None:
        """Read no more for a while where a client has sent more requests than it may."""
        self._spent_until_s = max(self._spent_until_s, now_s) + requests / REQUESTS_PER_S
        ahead_s = self._spent_until_s - now_s - AT_ONCE_S
        if ahead_s > 0 and self._waiting is None and not self._ended:
            self._transport.pause_reading()
            self._waiting = asyncio.get_running_loop().call_later(ahead_s, self._end_wait)

    def _end_wait(self) -> None:
        self._waiting = None
        self._read_on()

    def _keep(self, used: int, size: int) -> None:
        """Move an incomplete request to the front."""
        self._filled = size - used
        if not self._filled:
            self.unfinished_since_s = None
            return
        if used:
            self._buffer[: self._filled] = self._buffer[used:size]
        if used or self.unfinished_since_s is None:
            self.unfinished_since_s = self._manager.now_s()

    def eof_received(self) -> None:
        """Close the connection after the client's last byte: no request is left."""

    def pause_writing(self) -> None:
        """Read no more requests while the client does not take its responses."""
        self.stalled_since_s = self._manager.now_s()
        self._transport.pause_reading()

    def resume_writing(self) -> None:
        """Go on reading."""
        self.stalled_since_s = None
        self._read_on()

    def _read_on(self) -> None:
        if self._ended or self._waiting is not None or self.stalled_since_s is not None:
            return
        if self.unfinished_since_s is not None:  # its rest waited in the kernel, for our sake
            self.unfinished_since_s = self._manager.now_s()
        self._transport.resume_reading()

    def _end(self, why: str) -> None:
        if not self._ended:
            self._ended = True
            if self._waiting is not None:
                self._waiting.cancel()
            self._manager.gone(self.peer, why)
