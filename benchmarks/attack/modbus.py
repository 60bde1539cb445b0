"""Attacks on Modbus."""

import contextlib
import random
import socket
import struct
import threading
import time
from collections import Counter

from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.map import BY_NAME

from .bystanders import HOST
from .malformed_frames import CLOSED, GOOD, GOOD_ANSWER, KINDS, UNIT, in_parts
from .target import CONNECT_S, STRANGER, STRANGERS, Attack, Found, Target, crowd, silent, still_open

SILENT, HALF, DRIPPING, GREEDY, DEAF = 250, 40, 26, 4, 20
FRAMES_A_SECOND = 375
SEED = 20_261_123
BUSY = 6
_FRAME_ENDS_S = 6.0
"""A connection with half a frame is ended within 5 s."""
_DEAF_END_S = 40.0
"""Until then all that the kernels buffer is answered, and no client has read it for 5 s, on a busy machine too."""


def _frame(message: bytes, transaction: int = 1) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(message) + 1, UNIT) + message


READ = _frame(struct.pack(">BHH", 3, 100, 20))
REPLY_BYTES = 9 + 2 * 20


class Wire:
    """A connection that speaks frames."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection((HOST, port), CONNECT_S, (STRANGER, 0))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def receive(self) -> tuple[int, int, bytes]:
        """Return transaction, unit and message of the next frame; a unit of -1 at the connection's end."""
        head = self.socket.recv(7, socket.MSG_WAITALL)
        if len(head) < 7:
            return 0, -1, head
        transaction, _, length, unit = struct.unpack(">HHHB", head)
        return transaction, unit, self.socket.recv(length - 1, socket.MSG_WAITALL)

    def is_closed(self) -> bool:
        """Return whether the connection ends, rather than a byte or nothing coming."""
        try:
            return self.socket.recv(1) == b""
        except TimeoutError:
            return False
        except OSError:
            return True


def silent_one(target: Target) -> Found:
    """One machine that connects and requests nothing."""
    return silent(target.modbus, SILENT, (STRANGER,), target.seconds)


def silent_many(target: Target) -> Found:
    """The same from 250 addresses."""
    return silent(target.modbus, SILENT, STRANGERS, target.seconds)


def silent_tls(target: Target) -> Found:
    """One machine that connects to the TLS port and begins no handshake."""
    return silent(target.modbus_tls, SILENT, (STRANGER,), target.seconds)


def flood(target: Target) -> Found:
    """Connections as fast as they can be made."""
    tries = refused = 0
    until_s = time.monotonic() + target.seconds
    while time.monotonic() < until_s:
        tries += 1
        try:
            socket.create_connection((HOST, target.modbus), CONNECT_S, (STRANGER, 0)).close()
        except OSError:
            refused += 1
    return Found(tries, f"{refused} refused by the kernel")


def half_headers(target: Target) -> Found:
    """Three bytes of a header, and no more."""
    with crowd(target.modbus, HALF, STRANGERS, READ[:3]) as clients:
        at_start = still_open(clients)
        time.sleep(max(target.seconds, _FRAME_ENDS_S))
        left = still_open(clients)
    return Found(HALF, f"{at_start} open at first, {left} at the end", f"{left} not ended" if left else "")


def drip(target: Target) -> Found:
    """A byte each 0.6 s."""
    with crowd(target.modbus, DRIPPING, STRANGERS) as clients:
        until_s = time.monotonic() + max(target.seconds, _FRAME_ENDS_S + 2.0)
        sent = 0
        while time.monotonic() < until_s:
            for client in clients:
                with contextlib.suppress(OSError):
                    client.send(READ[sent % len(READ) :][:1])
            sent += 1
            time.sleep(0.6)
        left = still_open(clients)
    return Found(DRIPPING, f"{left} left at the end", f"{left} not ended" if left else "")


def pipelining(target: Target) -> Found:
    """500 requests at once on each of four connections, over and over."""
    answered = [0] * GREEDY
    until_s = time.monotonic() + target.seconds

    def one(number: int) -> None:
        with contextlib.closing(Wire(target.modbus).socket) as client, contextlib.suppress(OSError):
            while time.monotonic() < until_s:
                client.sendall(READ * 500)
                answered[number] += len(client.recv(500 * REPLY_BYTES, socket.MSG_WAITALL)) // REPLY_BYTES

    threads = [threading.Thread(target=one, args=(number,)) for number in range(GREEDY)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return Found(sum(answered), "all answered", "" if all(answered) else "a connection got no answer")


def never_read(target: Target) -> Found:
    """Requests whose answers are not read."""
    taken = 0
    with crowd(target.modbus, DEAF, STRANGERS) as clients:
        until_s = time.monotonic() + _DEAF_END_S
        ended: set[int] = set()
        while time.monotonic() < until_s and len(ended) < len(clients):
            for number, client in enumerate(clients):
                client.settimeout(0.0)
                try:
                    taken += client.send(READ * 500)
                except BlockingIOError:
                    continue
                except OSError:
                    ended.add(number)
            time.sleep(0.01)
    seen = f"{taken / 1e6:.1f} MB taken, {len(ended)} of {DEAF} ended"
    return Found(taken // len(READ), seen, "" if len(ended) == len(clients) else "not all ended")


def _refused_writes(target: Target, message: bytes) -> Found:
    codes: Counter[str] = Counter()
    until_s = time.monotonic() + target.seconds
    wire = Wire(target.modbus)
    with contextlib.closing(wire.socket):
        while time.monotonic() < until_s:
            wire.socket.sendall(_frame(message))
            answer = wire.receive()[2]
            codes[f"exception {answer[1]:02}" if answer[:1] == bytes([0x90]) else f"answer {answer.hex()}"] += 1
    only_busy = set(codes) == {f"exception {BUSY:02}"}
    seen = ", ".join(f"{count:,} x {code}" for code, count in codes.items())
    return Found(codes.total(), seen, "" if only_busy else "not refused each time")


def second_writer(target: Target) -> Found:
    """Another client that may write, beside the PLC that has the right to."""
    return _refused_writes(target, struct.pack(">BHHBH", 16, BY_NAME["write_key"].address, 1, 2, WRITE_KEY))


def replays(target: Target) -> Found:
    """Read what the PLC has written, and write it again, key and trigger included; each such write must be refused."""
    wire = Wire(target.modbus)
    count = BY_NAME["size_class"].address + 1
    with contextlib.closing(wire.socket):
        wire.socket.sendall(_frame(struct.pack(">BHH", 3, 0, count)))
        words = wire.receive()[2][2:]
    return _refused_writes(target, struct.pack(">BHHB", 16, 0, len(words) // 2, len(words)) + words)


def random_frames(target: Target) -> Found:
    """Valid headers around random bytes."""
    source, sent, answers = random.Random(SEED), 0, 0
    until_s = time.monotonic() + target.seconds
    wire = Wire(target.modbus)
    while time.monotonic() < until_s:
        try:
            function = source.choice([code for code in range(256) if code not in {5, 6, 15, 16, 22, 23}])
            wire.socket.sendall(_frame(bytes([function]) + source.randbytes(source.randint(0, 252)), sent % 65_536))
            answers += wire.receive()[1] == UNIT
        except OSError:
            pass
        else:
            sent += 1
            continue
        wire.socket.close()
        wire = Wire(target.modbus)
    wire.socket.close()
    return Found(sent, f"{answers:,} answered", "" if answers == sent else f"{sent - answers} without an answer")


def oracle(target: Target) -> Found:
    """Frames that are wrong in one known way each, alone, behind a good one, whole or in parts."""
    source, wrong = random.Random(SEED), Counter[str]()
    frames = round(FRAMES_A_SECOND * target.seconds)
    wire = Wire(target.modbus)
    for number in range(frames):
        bad = KINDS[number % len(KINDS)](source)
        glued = source.random() < 0.3
        with contextlib.suppress(OSError):
            for part in in_parts(source, _frame(GOOD, 7) + bad.data if glued else bad.data):
                wire.socket.sendall(part)
            if bad.half_close:
                wire.socket.shutdown(socket.SHUT_WR)
        right = not glued or wire.receive() == (7, UNIT, GOOD_ANSWER)
        if bad.code == CLOSED:
            right = wire.is_closed() and right
        else:
            transaction, _, _, unit, function = struct.unpack_from(">HHHBB", bad.data)
            right = wire.receive() == (transaction, unit, bytes([function | 0x80, bad.code])) and right
        wrong[bad.kind] += not right
        if bad.code == CLOSED or not right:
            wire.socket.close()
            wire = Wire(target.modbus)
    wire.socket.close()
    missed = ", ".join(f"{kind}: {count}" for kind, count in wrong.items() if count)
    return Found(frames, f"{len(KINDS)} kinds, {wrong.total()} with another answer than wanted", missed)


ATTACKS = (
    Attack("plc", "250 silent connections from one address", silent_one),
    Attack("plc", "250 silent connections from 250 addresses", silent_many),
    Attack("plc", "250 connections to the TLS port without a handshake", silent_tls),
    Attack("plc", "connect flood", flood),
    Attack("plc", "half headers", half_headers),
    Attack("plc", "drip, a byte each 0.6 s", drip),
    Attack("plc", "pipelining, 4 x 500 requests at once", pipelining),
    Attack("plc", "readers who never read", never_read),
    Attack("plc", "second writer", second_writer),
    Attack("plc", "the PLC's telegram, replayed by another machine", replays),
    Attack("plc", "random frames", random_frames),
    Attack("plc", "wrong frames with an oracle", oracle),
)
