"""Modbus RTU byte for byte: the frames that Robotiq's manual prints, and what is no frame."""

import asyncio
from collections.abc import Callable
from struct import pack
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU

from station.twin.robotiq.faults import gripper_faults
from station.twin.robotiq.fingers import Fingers
from station.twin.robotiq.load import Spring
from station.twin.robotiq.model import RobotiqGripper
from station.twin.robotiq.registers import Command
from station.twin.robotiq.rtu import RequestFramer, answer, crc16, framed
from tests.manual_clock import ManualClock

RESET = "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30"
ACKNOWLEDGED = "09 10 03 E8 00 03 01 30"
CLOSE = "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29"
OPEN = "09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19"
READ_ONE = "09 03 07 D0 00 01 85 CF"
READ_THREE = "09 03 07 D0 00 03 04 0E"


class Line:
    """A gripper with the travel of the manual's examples (13 when open, 189 on its object) behind a framer."""

    def __init__(self) -> None:
        self.clock = ManualClock()
        fingers = Fingers(open_count=13, closed_count=230)
        held_mm = fingers.opening_mm(189)
        self.gripper = RobotiqGripper(self.clock, gripper_faults(), fingers=fingers)
        self.object = Spring(free_mm=held_mm + 0.05, stiffness_n_per_mm=5000.0)
        self.framer = RequestFramer()

    def exchange(self, request: str) -> str:
        frames = self.framer.feed(bytes.fromhex(request), self.clock.now_s())
        answers = [answer(frame, self.gripper) for frame in frames]
        return b"".join(one for one in answers if one).hex(" ").upper()

    def activated(self) -> "Line":
        self.exchange(framed(bytes.fromhex("09 10 03 E8 00 03 06 01 00 00 00 00 00")).hex())
        self.clock.advance(3.0)
        return self


def test_the_manual_s_activation():
    line = Line()
    assert line.exchange(RESET) == ACKNOWLEDGED
    assert line.exchange("09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1") == ACKNOWLEDGED
    assert line.exchange(READ_ONE) == "09 03 02 11 00 55 D5"
    line.clock.advance(3.0)
    assert line.exchange(READ_ONE) == "09 03 02 31 00 4C 15"


def test_the_manual_s_grip():
    line = Line().activated()
    line.gripper.load = line.object
    assert line.exchange(CLOSE) == ACKNOWLEDGED
    line.clock.advance(0.0027)
    assert line.exchange(READ_THREE) == "09 03 06 39 00 00 FF 0E 0A F7 8B"
    line.clock.advance(3.0)
    assert line.exchange(READ_THREE) == "09 03 06 B9 00 00 FF BD 00 1D 7C"
    assert line.exchange("09 04 07 D0 00 03 B1 CE") == "09 04 06 B9 00 00 FF BD 00 5C 9A"


def test_the_manual_s_opening():
    line = Line().activated()
    line.exchange(CLOSE)
    line.clock.advance(3.0)
    assert line.exchange(OPEN) == ACKNOWLEDGED
    line.clock.advance(3.0)
    assert line.exchange(READ_THREE) == "09 03 06 F9 00 00 00 0D 00 56 4C"
    assert line.exchange("09 04 07 D0 00 03 B1 CE") == "09 04 06 F9 00 00 00 0D 00 17 AA"


def test_the_manual_s_close_is_answered_byte_for_byte_on_every_wire(on: Callable[..., Any]):
    async def scenario(rig: Any) -> bytes:
        reader, writer = await asyncio.open_connection(rig.server.host, rig.server.port)
        writer.write(bytes.fromhex(CLOSE))
        reply = await reader.readexactly(8)
        writer.close()
        await writer.wait_closed()
        return reply

    assert on("rtu over tcp", scenario) == bytes.fromhex(ACKNOWLEDGED)


@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        ("09 06 03 E8 01 00", "09 86 01"),
        ("09 03 07 D8 00 01", "09 83 02"),
        ("09 03 07 D0 00 00", "09 83 03"),
        ("09 10 07 D0 00 01 02 00 00", "09 90 02"),
        ("09 10 03 E8 00 02 02 00 00", "09 90 03"),
        ("08 03 07 D0 00 01", ""),
    ],
    ids=["function 6", "beyond the block", "no register", "status is read only", "length and count differ", "unit 8"],
)
def test_what_is_refused_and_how(request_: str, reply: str):
    expected = framed(bytes.fromhex(reply)).hex(" ").upper() if reply else ""
    assert Line().exchange(framed(bytes.fromhex(request_)).hex()) == expected


@given(
    st.builds(
        Command,
        **{name: st.booleans() for name in ("activate", "go_to", "release", "release_opens")},
        **{name: st.integers(0, 255) for name in ("position", "speed", "force")},
    )
)
def test_a_command_survives_its_registers(command: Command):
    assert Command.from_words(command.words()) == command


def test_each_bit_of_the_action_is_where_the_manual_has_it():
    bits = {"activate": 0x0100, "go_to": 0x0800, "release": 0x1000, "release_opens": 0x2000}
    for name, word in bits.items():
        assert Command(**{name: True}).words() == [word, 0, 0]


def test_function_23_writes_before_it_reads_and_writes_nothing_when_the_read_is_refused():
    line = Line()
    write = "03 E8 00 03 06 01 00 00 37 00 00"
    assert line.exchange(framed(bytes.fromhex(f"09 17 07 D0 00 09 {write}")).hex())[:8] == "09 97 02"
    assert line.exchange(framed(bytes.fromhex(f"09 17 07 D0 00 02 {write}")).hex())[:20] == "09 17 04 11 00 00 37"


@given(st.binary(max_size=64))
def test_the_crc_is_pymodbus_crc(data: bytes):
    assert crc16(data) == pack(">H", FramerRTU.compute_CRC(data))


@given(st.lists(st.integers(1, 14), max_size=8), st.integers(1, 3))
def test_frames_in_pieces_and_in_one_piece_are_the_same(cuts: list[int], repeated: int):
    stream = bytes.fromhex(CLOSE) * repeated
    framer, frames, at = RequestFramer(), [], 0
    for cut in [*cuts, len(stream)]:
        frames += framer.feed(stream[at : at + cut], 1.0)
        at += cut
    assert frames == [bytes.fromhex(CLOSE)[:-2]] * repeated


@given(st.binary(max_size=300))
def test_noise_is_no_frame_and_a_silence_heals_the_line(noise: bytes):
    framer = RequestFramer()
    for frame in framer.feed(noise, 1.0):
        assert framed(frame) in noise
    assert framer.feed(bytes.fromhex(READ_ONE), 2.0) == [bytes.fromhex(READ_ONE)[:-2]]


def test_a_wrong_crc_is_met_with_silence():
    assert Line().exchange("09 03 07 D0 00 01 85 CE") == ""
