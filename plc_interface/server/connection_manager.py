"""Connection manager: admission, the exclusive writer, counters, log, and time-outs of all connections."""

import asyncio
import logging
from typing import Protocol

from plc_interface.server.access import AllowList, plain_address
from plc_interface.server.exceptions import ExceptionCode, RequestError, Trouble
from plc_interface.server.image import RegisterImage
from plc_interface.server.log_limit import LimitedLog
from plc_interface.server.peer import Peer
from plc_interface.server.request_handler import OnWrite, RequestHandler
from plc_interface.server.statistics import Statistics
from plc_interface.server.tls import Right, identity_of
from plc_interface.server.write_lock import OnWriter, WriteLock, WriterChange
from station.settings.modbus import ModbusSettings

RESERVED_PLACES = 4
"""Connections beyond the limit for the client that wrote last, or for one that may write and has no connection."""
SWEEP_S = 0.1
"""Period of the check for connections that have to end. An estimate."""

log = logging.getLogger(__name__)


class Member(Protocol):
    """The connection manager's view of a connection."""

    peer: Peer | None
    heard_s: float
    unfinished_since_s: float | None
    stalled_since_s: float | None

    def drop(self, trouble: Trouble | None = None, why: str = "") -> None:
        """Close the connection at once."""


class ConnectionManager:
    """Manages all connections. Belongs to the event loop; nothing in it waits."""

    def __init__(self, settings: ModbusSettings, image: RegisterImage, on_write: OnWrite, on_writer: OnWriter) -> None:
        self._settings, self._on_writer = settings, on_writer
        self._loop = asyncio.get_running_loop()
        self.now_s = self._loop.time
        self._readers, self._writers = AllowList(settings.readers), AllowList(settings.writers)
        self._members: dict[Peer, Member] = {}
        self._handshakes: dict[Member, Peer] = {}
        """Clients of the TLS port that have a place and no identity yet."""
        self._log = LimitedLog(log)
        self._sweeping: asyncio.TimerHandle | None = None
        self._is_closed = False
        self.write_lock = WriteLock(settings.writer_lease_s, self._report_writer)
        self._handler = RequestHandler(
            settings.unit, image, on_write, self._claim, self.write_lock.owned_by, self.write_lock.release
        )
        self.statistics = Statistics()

    @property
    def connections(self) -> int:
        """Number of connected clients."""
        return len(self._members)

    def open(self) -> None:
        """Start the checks for connections that have to end."""
        self._sweeping = self._loop.call_later(SWEEP_S, self._sweep)

    def close(self) -> None:
        """Close all connections, and admit none any more. Idempotent."""
        self._is_closed = True
        if self._sweeping is not None:
            self._sweeping.cancel()
        for member in tuple(self._members.values()):
            member.drop()
        self._handshakes.clear()
        self._log.sum_up(self.now_s(), last=True)

    def enter(self, member: Member, transport: asyncio.Transport) -> bool:
        """Give a client a place for its TLS handshake, by its address alone; return False if it is refused."""
        peer, right = self._identify(transport)
        if peer is None or not self._permits(peer, right):
            return False
        self._handshakes[member] = peer
        return True

    def leave(self, member: Member, why: str) -> None:
        """Free a client's place at the end of its TLS handshake; `why` it failed, empty if it did not."""
        peer = self._handshakes.pop(member, None)
        if peer is not None and why:
            self.note(Trouble.NO_HANDSHAKE, peer, f"its TLS handshake failed ({why}): its connection is closed")

    def admit(self, member: Member, transport: asyncio.Transport) -> Peer | None:
        """Return the connection's peer, or None if it is refused."""
        peer, right = self._identify(transport)
        self._handshakes.pop(member, None)  # it needs no second place
        if peer is None or not self._permits(peer, right):
            return None
        self._members[peer] = member
        self.statistics.connections += 1
        self._log.write("connects", self.now_s(), logging.INFO, "%s: it has connected", peer)
        return peer

    def gone(self, peer: Peer | None, why: str) -> None:
        """Remove a client, None if it was refused; `why` is a sentence for the log, empty if the log has it already."""
        if peer is None or self._members.pop(peer, None) is None:
            return
        if why:
            self._log.write("disconnects", self.now_s(), logging.INFO, "%s: %s", peer, why)
        self.write_lock.disconnected(peer)

    def answer(self, peer: Peer, unit: int, message: bytes) -> bytes:
        """Return the response to a request, from its function code on; an exception response to a bad one."""
        self.statistics.requests += 1
        try:
            return self._handler.respond(peer, unit, message)
        except RequestError as error:
            code = error.code
            self.note(error.trouble, peer, f"function {message[0]} answered with exception {code:02}: {error}")
        except Exception as error:  # noqa: BLE001 (a fault of ours must not end the PLC's connection)
            code = ExceptionCode.DEVICE_FAILURE
            self.note(Trouble.DEVICE_FAILURE, peer, f"function {message[0]} answered with exception 04: {error!r}")
        return bytes((message[0] | 0x80, code))

    def note(self, trouble: Trouble, peer: Peer | None, why: str) -> None:
        """Count, and log within the limit."""
        self.statistics.troubles[trouble] += 1
        self._log.write(trouble, self.now_s(), logging.WARNING, "%s: %s", peer, why)

    def _identify(self, transport: asyncio.Transport) -> tuple[Peer | None, Right]:
        """Return a connection's other end, None if it is gone already, and its right by its certificate, if any."""
        name = transport.get_extra_info("peername")
        subject, right = identity_of(transport.get_extra_info("ssl_object"))
        if not name:
            return None, right
        address, port = plain_address(name[0]), name[1]
        return Peer(address, port, right is Right.WRITE and self._writers.allows(address), subject), right

    def _permits(self, peer: Peer, right: Right) -> bool:
        """Return whether a client may be connected; count and log it if not."""
        if self._is_closed:  # it was accepted, or ended its handshake, meanwhile
            return False
        if not self._readers.allows(peer.address):
            self.note(Trouble.NOT_ALLOWED, peer, "it is not in modbus.readers: its connection is closed")
            return False
        if right is Right.NONE:
            self.note(Trouble.NOT_ALLOWED, peer, "its certificate has no role known here: its connection is closed")
            return False
        if (full := self._full(peer)) and not self._has_reserve(peer):
            self.note(Trouble.TOO_MANY, peer, f"{full}: its connection is closed")
            return False
        return True

    def _claim(self, peer: Peer) -> bool:
        holder = self._members.get(self.write_lock.holder) if self.write_lock.holder else None
        return self.write_lock.claim(peer, self.now_s(), holder.heard_s if holder else 0.0)

    def _report_writer(self, peer: Peer | None, change: WriterChange) -> None:
        who = f"{peer} is the writer" if peer else "there is no writer"
        self._log.write("changes of the writer", self.now_s(), logging.INFO, "%s: %s", who, change)
        try:
            self._on_writer(peer, change)
        except Exception as error:  # noqa: BLE001 (a fault of ours must not keep the connections from being swept)
            self.note(Trouble.DEVICE_FAILURE, peer, f"the handshake failed on a change of the writer: {error!r}")

    def _full(self, peer: Peer) -> str:
        """Return why there is no place for a client; empty where there is one."""
        if self._taken >= self._settings.max_connections:
            return f"{self._taken} are connected"
        own = self._own(peer)
        return f"{own} of its address are connected" if own >= self._settings.max_per_address else ""

    @property
    def _taken(self) -> int:
        return len(self._members) + len(self._handshakes)

    def _own(self, peer: Peer) -> int:
        return sum(other.address == peer.address for other in (*self._members, *self._handshakes.values()))

    def _has_reserve(self, peer: Peer) -> bool:
        settings = self._settings
        if not peer.may_write or self._taken >= settings.max_connections + RESERVED_PLACES:
            return False
        if self._own(peer) >= settings.max_per_address + RESERVED_PLACES:
            return False
        if self.write_lock.last_address:
            return peer.address == self.write_lock.last_address
        return not self._own(peer)

    def _sweep(self) -> None:
        # First: a fault below must not end the checks.
        self._sweeping = self._loop.call_later(SWEEP_S, self._sweep)
        now_s, settings = self.now_s(), self._settings
        for member in tuple(self._members.values()):
            if member.stalled_since_s is not None:  # the rest of a request then waits in the kernel, for our sake
                if _older(member.stalled_since_s, now_s - settings.frame_timeout_s):
                    member.drop(Trouble.SLOW_READER, f"responses not taken for {settings.frame_timeout_s:g} s")
            elif _older(member.unfinished_since_s, now_s - settings.frame_timeout_s):
                member.drop(Trouble.UNFINISHED, f"no whole request in {settings.frame_timeout_s:g} s")
            elif _older(member.heard_s, now_s - settings.idle_timeout_s):
                member.drop(Trouble.IDLE, f"no request in {settings.idle_timeout_s:g} s")
        self.write_lock.expire(now_s)
        self._log.sum_up(now_s)


def _older(since_s: float | None, limit_s: float) -> bool:
    return since_s is not None and since_s < limit_s
