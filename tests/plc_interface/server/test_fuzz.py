"""Three thousand frames that are wrong in one known way each, and what has to come of them.

A good client beside them is served all the while, the log stays small, and tshark, where there is one, finds nothing
malformed in what the server sends.
"""

import contextlib
import random
import socket
import struct
import subprocess
import threading
from pathlib import Path

import pytest

from benchmarks.attack.malformed_frames import (
    CLOSED,
    GOOD,
    GOOD_ANSWER,
    KINDS,
    UNIT,
    in_parts,
    length_beyond_what_comes,
    truncated,
)
from tests.tools import required

FRAMES = 3000
SEED = 20_260_701
LOG_BYTES = 100_000
LINE_HEAD_BYTES = 60
"""Time, level and name before a line's text."""


class Capture:
    """Capture file, for tshark, of what a server sent: no right to listen on a network is needed.

    Source: libpcap's file format 2.4 with link type 101, raw IP.
    """

    def __init__(self, port: int) -> None:
        self.port, self.frames = port, 0
        self._records: list[bytes] = []
        self._sequence = 1

    def add(self, frame: bytes) -> None:
        tcp = struct.pack(">HHIIBBHHH", self.port, 40_000, self._sequence, 1, 5 << 4, 0x18, 65_535, 0, 0)
        addresses = b"\x0a\0\0\1\x0a\0\0\2"
        packet = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(frame), 0, 0, 64, 6, 0) + addresses + tcp + frame
        self._records.append(struct.pack("<IIII", 0, self.frames, len(packet), len(packet)) + packet)
        self._sequence += len(frame)
        self.frames += 1

    def judged(self, file: Path, expression: str) -> list[str]:
        """The lines that tshark prints of the packets for which the expression holds."""
        file.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65_535, 101) + b"".join(self._records))
        command = ["tshark", "-r", str(file), "-o", f"mbtcp.tcp.port:{self.port}", "-Y", expression]
        printed = subprocess.run(command, capture_output=True, text=True, check=True, timeout=100)
        return printed.stdout.splitlines()


class GoodClient(threading.Thread):
    """Sends the same request over and over, and checks for the right answer each time."""

    def __init__(self, wire) -> None:
        super().__init__(name="good client", daemon=True)
        self.wire, self.answers = wire, 0
        self.wrong: AssertionError | OSError | None = None
        self.enough = threading.Event()

    def run(self) -> None:
        try:
            while not self.enough.is_set():
                assert self.wire.exchange(GOOD) == GOOD_ANSWER
                self.answers += 1
        except (AssertionError, OSError) as error:
            self.wrong = error


@pytest.fixture
def serving(serve):
    return serve()


@pytest.fixture
def good_client(serving, connect):
    client = GoodClient(connect(serving, "127.0.0.2"))
    client.start()
    yield client
    client.enough.set()
    client.join(20.0)


def play(frames, serving, connect):
    """Send malformed frames, alone or glued to a good one, whole or in parts; what the server sent is captured."""
    source, capture, wire = random.Random(SEED), Capture(serving.settings.port), connect(serving)

    def answered(transaction: int, unit: int, message: bytes) -> None:
        got = wire.receive()
        capture.add(struct.pack(">HHHB", got[0], 0, len(got[2]) + 1, got[1]) + got[2])
        assert got == (transaction, unit, message)

    for number in range(frames):
        bad = KINDS[number % len(KINDS)](source)
        glued = source.random() < 0.3
        with contextlib.suppress(OSError) if bad.code == CLOSED else contextlib.nullcontext():
            for part in in_parts(source, wire.request(GOOD) + bad.data if glued else bad.data):
                wire.send(part)
            if bad.half_close:
                wire.socket.shutdown(socket.SHUT_WR)
        if glued:
            answered(wire.transaction, UNIT, GOOD_ANSWER)
        if bad.code == CLOSED:
            assert wire.is_closed(), bad
            wire.close()
            wire = connect(serving)
        else:
            transaction, _, _, unit, function = struct.unpack_from(">HHHBB", bad.data)
            answered(transaction, unit, bytes([function | 0x80, bad.code]))
    return capture


def test_each_gets_its_exception_or_the_end(serving, good_client, connect, caplog):
    play(FRAMES, serving, connect)
    assert not serving.writes
    assert good_client.wrong is None
    assert good_client.answers > 100
    ends_quietly = [kind for kind in KINDS if kind in {truncated, length_beyond_what_comes}]
    assert serving.server.statistics.bad_requests >= FRAMES * (len(KINDS) - len(ends_quietly)) // len(KINDS)
    assert sum(len(record.getMessage()) + LINE_HEAD_BYTES for record in caplog.records) < LOG_BYTES
    assert any(line.startswith("lines left out") for line in caplog.messages)


def test_tshark_finds_nothing_malformed_in_the_answers(serving, connect, tmp_path):
    required("tshark")
    capture = play(20 * len(KINDS), serving, connect)
    wire = connect(serving)
    good = [
        GOOD,
        struct.pack(">BHH", 1, 0, 9),
        struct.pack(">BHH", 4, 100, 62),
        struct.pack(">BHH", 6, 26, 0x5AFE),
        struct.pack(">BHHBBB", 15, 0, 9, 2, 1, 0),
        struct.pack(">BHHBHH", 16, 0, 2, 4, 1, 9),
        struct.pack(">BHHH", 22, 0, 0xFFFF, 0),
        struct.pack(">BHHHHBH", 23, 100, 62, 1, 1, 2, 9),
        bytes([43, 14, 2, 0]),
    ]
    for message in good:
        answer = wire.exchange(message)
        assert answer[0] == message[0]
        capture.add(struct.pack(">HHHB", wire.transaction, 0, len(answer) + 1, 1) + answer)
    assert len(capture.judged(tmp_path / "good.pcap", "modbus")) == capture.frames
    assert capture.judged(tmp_path / "good.pcap", "_ws.malformed") == []
    capture.add(struct.pack(">HHHBB", 1, 0, 2, 1, 3))
    assert len(capture.judged(tmp_path / "bad.pcap", "_ws.malformed")) == 1
