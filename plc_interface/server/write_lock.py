"""Exclusive owner of the right to write."""

from collections.abc import Callable
from enum import StrEnum

from plc_interface.server.peer import Peer

SILENCE_S = 1.0
"""A writer without a request for this time may have lost its connection unnoticed: the same client,
on another connection, takes over. A PLC gives a connection up only after a longer wait for a reply."""


class WriterChange(StrEnum):
    """Reason of a change of the exclusive owner."""

    CLAIMED = "claimed"
    TAKEN_OVER = "taken over by another connection of the same client"
    DISCONNECTED = "its connection ended"
    TIMED_OUT = "it did not write in time"
    RELEASED = "given back"


OnWriter = Callable[[Peer | None, WriterChange], None]
"""Called with the writer, or None, and the reason."""


class WriteLock:
    """Grants the right to write to the first client that claims it, and withdraws it when that one is gone."""

    def __init__(self, lease_s: float, on_writer: OnWriter) -> None:
        self._lease_s, self._on_writer = lease_s, on_writer
        self._expires_s = 0.0
        self.holder: Peer | None = None
        self.last_address = ""
        """Of the client that wrote last; empty until one did."""

    def claim(self, peer: Peer, now_s: float, holder_heard_s: float) -> bool:
        """Claim or renew the right to write; False if another client has it, last heard at a monotonic time."""
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

    def owned_by(self, peer: Peer) -> bool:
        """Return whether this connection has the right to write."""
        return self.holder is peer

    def expire(self, now_s: float) -> None:
        """Withdraw the right if the owner did not write in time."""
        if self.holder is not None and now_s > self._expires_s:
            self._free(WriterChange.TIMED_OUT)

    def disconnected(self, peer: Peer) -> None:
        """Withdraw the right if it was this connection's."""
        if self.holder is peer:
            self._free(WriterChange.DISCONNECTED)

    def release(self) -> None:
        """Withdraw the right from any owner."""
        if self.holder is not None:
            self._free(WriterChange.RELEASED)

    def _free(self, change: WriterChange) -> None:
        self.holder = None
        self._on_writer(None, change)

    def _is_the_same_client(self, peer: Peer) -> bool:
        return self.holder is not None and (peer.address, peer.name) == (self.holder.address, self.holder.name)
