"""Every function code and every way to get a request wrong, byte by byte on the wire."""

import struct

import pytest

from plc_interface.registers.map import BY_NAME, REGISTERS, bit_address
from plc_interface.registers.register import Access, Kind
from plc_interface.server.exceptions import Trouble

CONTROL, TRIGGER_ID, KEY = (BY_NAME[name].address for name in ("control", "trigger_id", "write_key"))
BLOCK_END = BY_NAME["size_class"].end
UNMAPPED = 60
LAST = REGISTERS[-1].end


@pytest.fixture
def serving(serve):
    return serve()


@pytest.fixture
def plc(serving, connect):
    wire = connect(serving)
    wire.claim()
    serving.writes.clear()
    return wire


class TestReading:
    @pytest.mark.parametrize("function", [3, 4])
    def test_registers(self, serving, plc, function):
        serving.call(serving.image.commit, {"result_trigger_id": 0x1234, "result_area_mm2": 12.5})
        address = BY_NAME["result_trigger_id"].address
        assert plc.read(address, 1, function) == b"\x12\x34"
        assert struct.unpack(">f", plc.read(BY_NAME["result_area_mm2"].address, 2, function))[0] == 12.5

    @pytest.mark.parametrize("function", [1, 2])
    def test_flags_lie_in_the_order_of_their_numbers(self, serving, plc, function):
        status = BY_NAME["status"]
        serving.call(serving.image.commit, {"status": status.flags(["trigger_ready", "simulated"])})
        assert plc.read(bit_address(status, 0), 16, function) == bytes([0b10, 0b1000_0000])
        assert plc.read(bit_address(status, 1), 3, function) == bytes([0b1])
        assert plc.read(bit_address(status, 15), 1, function) == bytes([0b1])

    def test_the_low_word_first(self, serve, connect):
        plc = connect(serve(word_order="low_first"))
        assert plc.read(BY_NAME["reference_u32"].address, 2) == b"\x56\x78\x12\x34"
        assert plc.read(BY_NAME["reference_text"].address, 2) == b"ABCD"

    def test_every_register_can_be_read_by_itself_and_no_other(self, plc):
        mapped = {address for register in REGISTERS for address in range(register.address, register.end)}
        for address in range(LAST + 2):
            answer = plc.exchange(struct.pack(">BHH", 3, address, 1))
            assert answer[:1] == (b"\x03" if address in mapped else b"\x83"), address

    def test_identification(self, plc):
        answer = plc.exchange(bytes([43, 14, 1, 0]))
        assert answer[:8] == bytes([43, 14, 1, 0x82, 0, 0, 3, 0])
        assert b"fruit-station" in answer
        assert plc.exchange(bytes([43, 14, 4, 4]))[6:8] == bytes([1, 4])


class TestWriting:
    def test_several_registers(self, serving, plc):
        assert plc.write(CONTROL, 1, 77, 0, 5) == struct.pack(">BHH", 16, CONTROL, 4)
        assert serving.writes == [{"control": 1, "trigger_id": 77, "acknowledged_sequence": 5}]
        assert plc.read(CONTROL, 4) == struct.pack(">4H", 1, 77, 0, 5)

    def test_one_register(self, serving, plc):
        request = struct.pack(">BHH", 6, TRIGGER_ID, 9)
        assert plc.exchange(request) == request
        assert serving.writes == [{"trigger_id": 9}]

    def test_coils_leave_the_other_flags_alone(self, serving, plc):
        plc.write(CONTROL, 0b101)
        request = struct.pack(">BHH", 5, bit_address(BY_NAME["control"], 1), 0xFF00)
        assert plc.exchange(request) == request
        assert serving.image.value("control") == 0b111
        request = struct.pack(">BHHBB", 15, bit_address(BY_NAME["control"], 0), 2, 1, 0b1111_1100)
        assert plc.exchange(request) == request[:5]
        assert serving.image.value("control") == 0b100

    def test_mask(self, serving, plc):
        plc.write(CONTROL, 0b101)
        request = struct.pack(">BHHH", 22, CONTROL, 0b100, 0b010)
        assert plc.exchange(request) == request
        assert serving.image.value("control") == 0b110

    def test_a_scan_in_one_round_trip(self, serving, plc):
        request = struct.pack(">BHHHHBHH", 23, TRIGGER_ID, 1, CONTROL, 2, 4, 1, 4711)
        assert plc.exchange(request) == struct.pack(">BBH", 23, 2, 4711)
        assert serving.writes == [{"control": 1, "trigger_id": 4711}]

    def test_text(self, serving, plc):
        plc.write(BY_NAME["lot"].address, *struct.unpack(">16H", b"LOT 7".ljust(32, b"\0")))
        assert serving.image.value("lot") == "LOT 7"

    @pytest.mark.parametrize("lot", [b"LOT 7\r", b"\xff" * 32])
    def test_a_lot_that_is_no_text_is_none_and_the_rest_of_the_scan_is_taken(self, serving, plc, lot):
        """Refused as a whole, each scan of a PLC that also writes its heartbeat would be lost with it."""
        address = BY_NAME["plc_heartbeat"].address
        assert plc.write(address, 5, 0, 0, *struct.unpack(">16H", lot.ljust(32, b"\0")))[0] == 16
        assert serving.writes == [{"plc_heartbeat": 5, "encoder": 0, "lot": None}]
        assert (serving.image.value("plc_heartbeat"), serving.image.value("lot")) == (5, None)
        assert plc.read(BY_NAME["lot"].address, 16) == bytes(32)

    def test_a_command_that_does_not_exist_is_left_to_the_handshake(self, serving, plc):
        assert plc.write(BY_NAME["command_code"].address, 99, 3)[0] == 16
        assert serving.writes == [{"command_code": 99, "command_argument": 3}]

    def test_a_fault_of_ours_is_answered_and_the_connection_stays(self, serving, plc, monkeypatch):
        monkeypatch.setattr(serving.image, "commit", lambda _: 1 / 0)
        assert plc.write(TRIGGER_ID, 9) == bytes([0x90, 4])
        monkeypatch.undo()
        assert plc.write(TRIGGER_ID, 9)[0] == 16


READ_ONLY = [register for register in REGISTERS if register.access is Access.READ_ONLY]
LONG = [register for register in REGISTERS if register.access is Access.READ_WRITE and register.words > 1]
BAD = {
    "function 8 is not served": (bytes([8, 0, 0, 0, 0]), 1),
    "function 0": (bytes([0]), 1),
    "a function code above 127": (bytes([0x83, 0, 0, 0, 1]), 1),
    "another encapsulated interface": (bytes([43, 13, 0, 0]), 1),
    "function 43 alone": (bytes([43]), 1),
    "no such identification code": (bytes([43, 14, 5, 0]), 3),
    "no such identification object": (bytes([43, 14, 4, 99]), 2),
    "no register asked for": (struct.pack(">BHH", 3, 0, 0), 3),
    "126 registers": (struct.pack(">BHH", 3, 100, 126), 3),
    "an unmapped register": (struct.pack(">BHH", 3, UNMAPPED, 1), 2),
    "beyond the last register": (struct.pack(">BHH", 3, LAST - 1, 2), 2),
    "beyond the last address": (struct.pack(">BHH", 4, 65_535, 2), 2),
    "too short a read": (bytes([3, 0, 0, 0]), 3),
    "too long a read": (bytes([3, 0, 0, 0, 1, 0]), 3),
    "2001 bits": (struct.pack(">BHH", 1, 0, 2001), 3),
    "bits of a number": (struct.pack(">BHH", 2, 16 * TRIGGER_ID, 1), 2),
    "bits beyond the last register": (struct.pack(">BHH", 1, 65_535, 16), 2),
    "a coil that is neither on nor off": (struct.pack(">BHH", 5, 0, 1), 3),
    "a coil of the status": (struct.pack(">BHH", 5, bit_address(BY_NAME["status"], 0), 0xFF00), 2),
    "a coil without a meaning": (struct.pack(">BHH", 5, 15, 0xFF00), 3),
    "coils with another byte count": (struct.pack(">BHHBB", 15, 0, 9, 1, 0), 3),
    "no coils": (struct.pack(">BHHB", 15, 0, 0, 0), 3),
    "registers with another byte count": (struct.pack(">BHHBH", 16, 0, 2, 2, 0), 3),
    "registers with fewer bytes than said": (struct.pack(">BHHBH", 16, 0, 2, 4, 0), 3),
    "124 registers": (struct.pack(">BHHB123H", 16, 0, 124, 246, *[0] * 123), 3),
    "a head without registers": (bytes([16, 0, 0]), 3),
    "an unmapped register written": (struct.pack(">BHH", 6, UNMAPPED, 1), 2),
    "a write that runs off the block": (struct.pack(">BHHBHH", 16, BLOCK_END - 1, 2, 4, 0, 0), 2),
    "flags without a meaning": (struct.pack(">BHH", 6, CONTROL, 0x8000), 3),
    "no such key": (struct.pack(">BHH", 6, KEY, 1), 3),
    "a mask on half a value": (struct.pack(">BHHH", 22, BY_NAME["encoder"].address, 0, 0), 3),
    "a mask on what is read only": (struct.pack(">BHHH", 22, BY_NAME["status"].address, 0, 0), 2),
    "122 registers beside a read": (struct.pack(">BHHHHB121H", 23, 0, 1, 0, 122, 242, *[0] * 121), 3),
    "no read beside the write": (struct.pack(">BHHHHBH", 23, 0, 0, 0, 1, 2, 1), 3),
    "an unmapped read beside the write": (struct.pack(">BHHHHBH", 23, UNMAPPED, 1, 0, 1, 2, 1), 2),
}
HEADINGS = {1: Trouble.ILLEGAL_FUNCTION, 2: Trouble.ILLEGAL_ADDRESS, 3: Trouble.ILLEGAL_VALUE}


@pytest.mark.parametrize("unit", [0, 255])
def test_a_client_may_mean_the_server_itself(plc, unit):
    assert plc.exchange(struct.pack(">BHH", 3, BY_NAME["reference_u16"].address, 1), unit) == b"\x03\x02\x12\x34"


class TestBadRequests:
    def refused(self, serving, plc, caplog, request, code, unit=1, heading=None):
        """The exception, its count, its line in the log with the peer, and nothing written."""
        troubles, before = serving.server.statistics.troubles, serving.call(serving.image.registers, 0, BLOCK_END)
        heading = heading or HEADINGS[code]
        count, lines = troubles[heading], len(caplog.records)
        assert plc.exchange(request, unit) == bytes([request[0] | 0x80, code])
        assert troubles[heading] == count + 1
        written = caplog.records[lines:]
        assert len(written) == 1
        peer = "{}:{}".format(*plc.socket.getsockname())
        assert written[0].getMessage().startswith(f"{peer}: function {request[0]} answered with exception {code:02}: ")
        assert serving.call(serving.image.registers, 0, BLOCK_END) == before
        assert not serving.writes

    @pytest.mark.parametrize(("request_", "code"), BAD.values(), ids=BAD)
    def test_each_has_its_exception_count_and_line(self, serving, plc, caplog, request_, code):
        self.refused(serving, plc, caplog, request_, code)

    @pytest.mark.parametrize("unit", [2, 247, 248, 254])
    def test_another_unit(self, serving, plc, caplog, unit):
        self.refused(serving, plc, caplog, struct.pack(">BHH", 3, 0, 1), 11, unit, Trouble.UNKNOWN_UNIT)

    def test_every_read_only_register(self, serving, plc):
        for register in READ_ONLY:
            for address in range(register.address, register.end):
                assert plc.write(address, 0) == bytes([0x90, 2]), register.name
        assert not serving.writes

    def test_every_part_of_every_long_value(self, serving, plc):
        for register in LONG:
            whole = register.words
            for begin in range(whole):
                for count in range(1, whole + 1 - begin):
                    if count < whole:
                        assert plc.write(register.address + begin, *[0] * count) == bytes([0x90, 3]), register.name
        assert not serving.writes

    def test_every_unmapped_register(self, serving, plc):
        mapped = {address for register in REGISTERS for address in range(register.address, register.end)}
        for address in [*range(LAST + 2), 0x7FFF, 0xFFFF]:
            if address not in mapped:
                assert plc.write(address, 0) == bytes([0x90, 2]), address
        assert not serving.writes

    def test_every_flag_without_a_meaning_and_every_unknown_key(self, serving, plc):
        writable = [register for register in REGISTERS if register.access is Access.READ_WRITE]
        for register in writable:
            if register.kind is Kind.BITS:
                bad = [1 << number for number in range(16) if not register.mask >> number & 1]
            elif register.address == KEY:
                bad = [1, 2, 50, 0xFFFF]
            else:
                continue
            for value in bad:
                assert plc.write(register.address, value) == bytes([0x90, 3]), (register.name, value)
        assert not serving.writes
