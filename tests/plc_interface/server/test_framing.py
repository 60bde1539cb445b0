"""Framing of Modbus ADUs: the end of one and the begin of the next are found, however TCP cuts them."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plc_interface.registers.map import BY_NAME
from plc_interface.server.exceptions import MalformedFrameError, Trouble
from plc_interface.server.mbap import LONGEST_MESSAGE, framed, frames

MESSAGES = st.lists(
    st.tuples(st.integers(0, 65_535), st.integers(0, 255), st.binary(min_size=1, max_size=LONGEST_MESSAGE)),
    min_size=1,
    max_size=5,
)
REFERENCE = BY_NAME["reference_u16"].address


@given(MESSAGES, st.data())
def test_frames_come_out_as_they_went_in_and_what_is_cut_off_waits(messages, data):
    stream = b"".join(framed(*message) for message in messages)
    cut = data.draw(st.integers(0, len(stream)))
    first = list(frames(stream, cut))
    used = first[-1][1] if first else 0
    rest = stream[used:]
    assert [frame for frame, _ in [*first, *frames(rest, len(rest))]] == messages


@given(st.binary(min_size=7, max_size=600))
def test_any_bytes_are_frames_or_malformed_or_unfinished(data):
    used = 0
    try:
        for (_, _, message), used in frames(data, len(data)):  # noqa: B007 (used behind the loop)
            assert 1 <= len(message) <= LONGEST_MESSAGE
    except MalformedFrameError:
        protocol, length = struct.unpack_from(">HH", data, used + 2)
        assert protocol != 0 or not 2 <= length <= LONGEST_MESSAGE + 1
    else:
        rest = data[used:]
        assert len(rest) < 7 or len(rest) < 6 + struct.unpack_from(">H", rest, 4)[0]


class TestPipelining:
    @pytest.fixture
    def plc(self, serve, connect):
        return connect(serve())

    def test_fifty_requests_at_once_are_answered_in_order(self, plc):
        addresses = [REFERENCE, 0, 9999, REFERENCE, 100] * 10
        plc.send(b"".join(plc.request(struct.pack(">BHH", 3, address, 1)) for address in addresses))
        for transaction, address in enumerate(addresses, start=1):
            expected = {REFERENCE: b"\x03\x02\x12\x34", 9999: b"\x83\x02"}.get(address, b"\x03\x02\0\0")
            assert plc.receive() == (transaction, 1, expected)

    def test_one_byte_at_a_time(self, plc):
        for byte in plc.request(struct.pack(">BHH", 3, REFERENCE, 1)):
            plc.send(bytes([byte]))
        assert plc.receive() == (1, 1, b"\x03\x02\x12\x34")

    def test_the_client_may_close_its_side_behind_its_requests(self, plc):
        plc.send(plc.request(struct.pack(">BHH", 3, REFERENCE, 1)))
        plc.socket.shutdown(1)
        assert plc.receive()[2] == b"\x03\x02\x12\x34"
        assert plc.is_closed()

    def test_good_requests_before_a_malformed_one_are_answered(self, plc):
        good = plc.request(struct.pack(">BHH", 3, REFERENCE, 1))
        plc.send(good + b"\0\1\0\7\0\6\1\3\0\0\0\1")
        assert plc.receive() == (1, 1, b"\x03\x02\x12\x34")
        assert plc.is_closed()


@pytest.mark.parametrize(
    "header",
    [b"\0\1\0\1\0\6\1", b"\0\1\0\0\0\0\1", b"\0\1\0\0\0\1\1", b"\0\1\0\0\0\xff\1", b"\0\1\0\0\7\xd0\1", b"GET / H"],
    ids=["protocol 1", "length 0", "length 1", "length 255", "length 2000", "HTTP"],
)
def test_a_header_that_is_no_modbus_ends_the_connection_with_a_count_and_a_line(serve, connect, caplog, header):
    serving = serve()
    wire = connect(serving)
    peer = "{}:{}".format(*wire.socket.getsockname())
    wire.send(header)
    assert wire.is_closed()
    assert serving.server.statistics.troubles[Trouble.MALFORMED_FRAME] == 1
    assert serving.server.statistics.bad_requests == 1
    assert [record for record in caplog.records if record.getMessage().startswith(f"{peer}: ")]
