"""Write lock of the Modbus server: one client owns it, until it disconnects, gives it back or stops writing."""

import struct

import pytest

from plc_interface.registers.bits import WRITE_KEY
from plc_interface.registers.map import BY_NAME
from plc_interface.server.exceptions import Trouble
from plc_interface.server.peer import Peer
from plc_interface.server.write_lock import SILENCE_S, WriteLock, WriterChange

KEY, TRIGGER_ID = BY_NAME["write_key"].address, BY_NAME["trigger_id"].address
BUSY = bytes([0x90, 6])


class TestLease:
    @pytest.fixture
    def changes(self):
        return []

    @pytest.fixture
    def lock(self, changes):
        return WriteLock(10.0, lambda peer, change: changes.append((peer, change)))

    def test_the_first_has_it_until_it_is_gone(self, lock, changes):
        one, other = Peer("10.0.0.1", 1, may_write=True), Peer("10.0.0.2", 2, may_write=True)
        assert lock.claim(one, 0.0, 0.0)
        assert lock.claim(one, 1.0, 1.0)
        assert not lock.claim(other, 5.0, 1.0)
        lock.disconnected(other)
        assert lock.holder is one
        lock.disconnected(one)
        assert lock.claim(other, 6.0, 0.0)
        assert changes == [
            (one, WriterChange.CLAIMED),
            (None, WriterChange.DISCONNECTED),
            (other, WriterChange.CLAIMED),
        ]

    def test_it_ends_without_writes(self, lock, changes):
        one = Peer("10.0.0.1", 1, may_write=True)
        lock.claim(one, 0.0, 0.0)
        lock.claim(one, 5.0, 5.0)
        lock.expire(14.9)
        assert lock.holder is one
        lock.expire(15.1)
        lock.expire(16.0)
        assert changes[1:] == [(None, WriterChange.TIMED_OUT)]

    def test_the_same_client_takes_over_from_its_silent_connection(self, lock, changes):
        old, new = Peer("10.0.0.1", 1, may_write=True), Peer("10.0.0.1", 2, may_write=True)
        lock.claim(old, 0.0, 0.0)
        assert not lock.claim(new, 3.0, 3.0 - SILENCE_S / 2)
        assert lock.claim(new, 3.0, 3.0 - 2 * SILENCE_S)
        lock.disconnected(old)
        assert lock.holder is new
        assert changes[1:] == [(new, WriterChange.TAKEN_OVER)]

    def test_another_certificate_is_another_client(self, lock):
        old = Peer("10.0.0.1", 1, may_write=True, name="CN=plc")
        new = Peer("10.0.0.1", 2, may_write=True, name="CN=laptop")
        lock.claim(old, 0.0, 0.0)
        assert not lock.claim(new, 9.0, 0.0)


class TestOnTheWire:
    def test_nothing_is_written_without_the_key(self, serve, connect):
        serving = serve()
        plc = connect(serving)
        assert plc.write(TRIGGER_ID, 7) == BUSY
        assert serving.server.writer is None
        assert serving.server.statistics.troubles[Trouble.NOT_WRITER] == 1
        plc.claim()
        assert plc.write(TRIGGER_ID, 7)[0] == 16

    def test_the_whole_block_may_bring_its_key(self, serve, connect):
        serving = serve()
        plc = connect(serving)
        assert plc.write(0, *[0] * 26, WRITE_KEY)[0] == 16
        assert serving.server.writer is not None

    def test_the_write_of_a_whole_scan_gives_the_key_back(self, serve, connect):
        serving = serve()
        plc, other = connect(serving), connect(serving, "127.0.0.2")
        assert other.write(0, *[0] * 27) == BUSY
        plc.claim()
        assert other.write(0, *[0] * 27) == BUSY
        assert plc.write(0, *[0] * 27)[0] == 16
        assert [change for _, change in serving.changes] == [WriterChange.CLAIMED, WriterChange.RELEASED]
        assert plc.write(0, *[0] * 27) == BUSY

    def test_another_client_is_refused_until_the_writer_disconnects(self, serve, connect, caplog):
        serving = serve()
        plc, other = connect(serving), connect(serving, "127.0.0.2")
        plc.claim()
        assert other.write(TRIGGER_ID, 7) == BUSY
        assert [line for line in caplog.messages if line.startswith("127.0.0.2:") and "another client" in line]
        assert other.read(TRIGGER_ID, 1) == b"\0\0"
        plc.close()
        serving.wait(lambda: serving.server.writer is None)
        assert other.write(TRIGGER_ID, 7)[0] == 16
        assert [change for _, change in serving.changes] == [
            WriterChange.CLAIMED,
            WriterChange.DISCONNECTED,
            WriterChange.CLAIMED,
        ]

    def test_giving_the_key_back(self, serve, connect):
        serving = serve()
        plc, other = connect(serving), connect(serving, "127.0.0.2")
        plc.claim()
        assert plc.write(KEY, 0)[0] == 16
        assert serving.server.writer is None
        assert [change for _, change in serving.changes] == [WriterChange.CLAIMED, WriterChange.RELEASED]
        assert other.write(TRIGGER_ID, 7) == BUSY
        other.claim()

    def test_reads_do_not_keep_the_lease(self, serve, connect, eventually):
        serving = serve(writer_lease_s=0.5)
        plc = connect(serving)
        plc.claim()

        def lost():
            plc.read(0, 1)
            return serving.changes[-1] == (None, WriterChange.TIMED_OUT)

        eventually(lost)
        assert plc.write(TRIGGER_ID, 7)[0] == 16

    def test_a_writer_whose_old_connection_hangs_takes_over(self, serve, connect, eventually, monkeypatch):
        monkeypatch.setattr("plc_interface.server.write_lock.SILENCE_S", 3.0)  # time enough for a machine that is busy
        serving = serve()
        hanging, back = connect(serving), connect(serving)
        hanging.claim()
        assert back.write(TRIGGER_ID, 7) == BUSY
        eventually(lambda: back.write(TRIGGER_ID, 7)[0] == 16)
        assert [change for _, change in serving.changes] == [WriterChange.CLAIMED, WriterChange.TAKEN_OVER]
        assert hanging.write(TRIGGER_ID, 8) == BUSY

    def test_an_invalid_write_takes_nothing(self, serve, connect):
        serving = serve()
        assert connect(serving).exchange(struct.pack(">BHH", 6, KEY, 1)) == bytes([0x86, 3])
        assert serving.server.writer is None
