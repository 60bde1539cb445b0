"""Responses of the Modbus server: read by a dissector that others wrote, which finds nothing malformed."""

import random
import struct
import subprocess
from pathlib import Path

import pytest

from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.map import BY_NAME
from tests.tools import required

CLIENT, SERVER = (40_000, "127.0.0.1"), (502, "127.0.0.1")
GOOD = (
    bytes.fromhex("01 0000 0002"),
    bytes.fromhex("02 0000 0002"),
    bytes.fromhex("03 0000 0014"),
    bytes.fromhex("04 0064 007d"),
    struct.pack(">BHH", 6, BY_NAME["write_key"].address, WRITE_KEY),
    bytes.fromhex("05 0000 ff00"),
    bytes.fromhex("0f 0000 0002 01 01"),
    bytes.fromhex("10 0000 0002 04 0001 004b"),
    bytes.fromhex("16 0000 fffe 0001"),
    bytes.fromhex("17 0000 0002 0002 0002 04 0000 0009"),
    *(bytes([0x2B, 14, code, 0]) for code in (1, 2, 3)),
    bytes.fromhex("2b 0e 04 01"),
)
BAD = (
    bytes.fromhex("07"),
    bytes.fromhex("03 003c 0001"),
    bytes.fromhex("03 0000 007e"),
    bytes.fromhex("10 0000 0002 03 000100"),
    bytes.fromhex("2b 0e 04 7f"),
    bytes.fromhex("2b 0d 00"),
)


@pytest.fixture
def tshark() -> str:
    return required("tshark")


def talk(wire, requests) -> list[tuple[bytes, bytes]]:
    """Send requests, and return what went over the wire: each request with its response, byte for byte."""
    exchanges = []
    for message in requests:
        request, answer = wire.request(message), b""
        wire.send(request)
        while len(answer) < 6 or len(answer) < 6 + int.from_bytes(answer[4:6]):
            part = wire.socket.recv(4096)
            assert part, f"the connection ended after {request.hex()}"
            answer += part
        exchanges.append((request, answer))
    return exchanges


def capture(file: Path, exchanges) -> None:
    """A file as a network analyser records one, of IPv4 packets without Ethernet (link type 101)."""
    packets = [struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65_535, 101)]
    sent = {CLIENT: 1, SERVER: 1}
    for request, answer in exchanges:
        for source, target, data in ((CLIENT, SERVER, request), (SERVER, CLIENT, answer)):
            tcp = struct.pack(">HHIIBBHHH", source[0], target[0], sent[source], sent[target], 5 << 4, 0x18, 8192, 0, 0)
            address = bytes([127, 0, 0, 1])
            ip = struct.pack(">BBHHHBBH", 0x45, 0, 40 + len(data), 0, 0, 64, 6, 0) + address + address
            whole = ip + tcp + data
            packets.append(struct.pack("<IIII", len(packets), 0, len(whole), len(whole)) + whole)
            sent[source] += len(data)
    file.write_bytes(b"".join(packets))


def dissected(tshark: str, file: Path) -> list[list[str]]:
    """Of each Modbus frame: source port, function code, whether it is an exception, what the dissector minds."""
    fields = ("tcp.srcport", "modbus.func_code", "modbus.exception_code", "_ws.malformed", "_ws.expert.message")
    command = [tshark, "-n", "-r", str(file), "-d", "tcp.port==502,mbtcp", "-Y", "mbtcp", "-T", "fields"]
    for field in fields:
        command += ["-e", field]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return [line.split("\t") for line in done.stdout.splitlines()]


def test_a_dissector_finds_nothing_malformed_in_any_answer(serve, connect, tshark, tmp_path):
    by_chance = random.Random(7)
    odd = [bytes([by_chance.randrange(1, 128)]) + by_chance.randbytes(by_chance.randrange(12)) for _ in range(200)]
    exchanges = talk(connect(serve()), [*GOOD, *BAD, *odd])
    file = tmp_path / "talk.pcap"
    capture(file, exchanges)
    answers = [row for row in dissected(tshark, file) if row[0] == str(SERVER[0])]
    assert len(answers) == len(exchanges)
    for (request, answer), (_, function, exception, malformed, minds) in zip(exchanges, answers, strict=True):
        refused = answer[7] >= 0x80
        assert int(function) == request[7] & 0x7F
        assert exception == (str(answer[8]) if refused else "")
        assert (malformed, minds) == ("", ""), (request.hex(), answer.hex())


def test_the_dissector_would_find_it(serve, connect, tshark, tmp_path):
    """An answer whose last object's length is too large, in a frame whose length agrees with what is there."""
    [(request, answer)] = talk(connect(serve()), [bytes.fromhex("2b 0e 01 00")])
    file = tmp_path / "talk.pcap"
    capture(file, [(request, answer[:4] + (len(answer) - 8).to_bytes(2) + answer[6:-2])])
    [_, (_, _, _, malformed, _)] = dissected(tshark, file)
    assert malformed
