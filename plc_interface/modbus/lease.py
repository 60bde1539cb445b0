"""The right to write, which one connection has at a time."""

from collections.abc import Callable
from enum import StrEnum

from plc_interface.modbus.peer import Peer

SILENCE_S = 1.0
"""A writer that asked nothing for this time may have lost its connection without our knowing: the same client, come
back on another connection, takes over. A PLC gives a connection up only after a longer wait for a reply."""


class WriterChange(StrEnum):
    """Why the right to write changed hands."""

    CLAIMED = "claimed"
    TAKEN_OVER = "taken over by another connection of the same client"
    DISCONNECTED = "its connection ended"
    TIMED_OUT = "it did not write in time"
    RELEASED = "given back"


OnWriter = Callable[[Peer | None, WriterChange], None]
"""Told the writer, or None where there is none any more, and why."""


class WriterLease:
    """Gives the right to write to the first that asks, and takes it back when that one is gone."""

    def __init__(self, lease_s: float, on_writer: OnWriter) -> None:
        self._lease_s, self._on_writer = lease_s, on_writer
        self._expires_s = 0.0
        self.holder: Peer | None = None
        self.last_address = ""
        """Of the client that wrote last; empty until one did."""

    def claim(self, peer: Peer, now_s: float, holder_heard_s: float) -> bool:
        """Take or renew the right to write; False where another has it.

        Args:
            peer: who wants to write.
            now_s: monotonic time.
            holder_heard_s: when the present holder last asked anything.
        """
        if self.holder is not peer:
            if self.holder is None:
                change = WriterChange.CLAIMED
            elif self._is_the_same_client(peer) and now_s - holder_heard_s > SILENCE_S:
                change = WriterChange.TAKEN_OVER
            else:
                return False
            self.holder, self.last_address = peer, peer.address
            self._on_writer(peer, change)
        self._expires_s = now_s + self._lease_s
        return True

    def expire(self, now_s: float) -> None:
        """Take the right back where the holder did not write in time."""
        if self.holder is not None and now_s > self._expires_s:
            self._free(WriterChange.TIMED_OUT)

    def disconnected(self, peer: Peer) -> None:
        """Take the right back if it was this connection's."""
        if self.holder is peer:
            self._free(WriterChange.DISCONNECTED)

    def release(self) -> None:
        """Take the right back, whoever has it."""
        if self.holder is not None:
            self._free(WriterChange.RELEASED)

    def _free(self, change: WriterChange) -> None:
        self.holder = None
        self._on_writer(None, change)

    def _is_the_same_client(self, peer: Peer) -> bool:
        return self.holder is not None and (peer.address, peer.name) == (self.holder.address, self.holder.name)
