"""Clients in crowds, clients that hang, clients that do not listen."""

import contextlib
import socket
import struct
import time

from plc_interface.registers.map import BY_NAME
from plc_interface.server.connection import REQUESTS_PER_S
from plc_interface.server.connection_manager import RESERVED_PLACES
from plc_interface.server.exceptions import Trouble

TRIGGER_ID, REFERENCE = BY_NAME["trigger_id"].address, BY_NAME["reference_u16"].address
READ = struct.pack(">BHH", 3, REFERENCE, 1)
GOOD = bytes([3, 2, 0x12, 0x34])


class TestLimit:
    def test_two_hundred_at_once_do_not_push_the_writer_out(self, serve, connect, crowd, caplog):
        serving = serve()
        plc = connect(serving)
        plc.claim()
        crowd(serving.settings.port, 200, "127.0.0.9")
        troubles = serving.server.statistics.troubles
        serving.wait(lambda: troubles[Trouble.TOO_MANY] >= 200 - serving.settings.max_connections)
        assert serving.call(lambda: serving.server.connections) == 1 + serving.settings.max_per_address
        assert plc.write(TRIGGER_ID, 7)[0] == 16
        assert serving.server.writer is not None
        assert sum(len(line) for line in caplog.messages) < 20_000

    def test_one_reader_leaves_places_to_the_others(self, serve, connect, crowd):
        serving = serve(max_per_address=5, writers=())
        crowd(serving.settings.port, 40, "127.0.0.9")
        serving.wait(lambda: serving.server.statistics.troubles[Trouble.TOO_MANY] >= 35)
        others = [connect(serving, f"127.0.1.{number}") for number in range(27)]
        assert all(other.exchange(READ) == GOOD for other in others)
        assert serving.call(lambda: serving.server.connections) == 32
        assert connect(serving, "127.0.2.1").is_closed()

    def test_the_writer_comes_back_beside_connections_that_it_lost(self, serve, connect, crowd):
        serving = serve(max_per_address=2)
        plc = connect(serving)
        plc.claim()
        crowd(serving.settings.port, 20, "127.0.0.1")
        serving.wait(lambda: serving.server.statistics.troubles[Trouble.TOO_MANY] >= 15)
        assert serving.call(lambda: serving.server.connections) == 2 + RESERVED_PLACES
        assert plc.write(TRIGGER_ID, 7)[0] == 16

    def test_the_writer_comes_back_into_a_full_house(self, serve, connect, crowd):
        serving = serve(max_connections=8)
        plc = connect(serving)
        plc.claim()
        crowd(serving.settings.port, 50, "127.0.0.9")
        serving.wait(lambda: serving.server.statistics.troubles[Trouble.TOO_MANY] >= 42)
        plc.reset()
        serving.wait(lambda: serving.server.writer is None)
        crowd(serving.settings.port, 20, "127.0.0.9")
        serving.wait(lambda: serving.server.statistics.troubles[Trouble.TOO_MANY] >= 61)
        back = connect(serving)
        assert back.write(TRIGGER_ID, 7)[0] == 16

    def test_the_reserve_has_an_end(self, serve, connect, crowd):
        serving = serve(max_connections=2)
        connect(serving).claim()
        crowd(serving.settings.port, 20, "127.0.0.1")
        serving.wait(lambda: serving.server.statistics.connections + serving.server.statistics.refused_connections > 20)
        assert serving.call(lambda: serving.server.connections) == 2 + RESERVED_PLACES

    def test_before_any_writer_one_that_may_write_finds_a_place(self, serve, connect, crowd):
        serving = serve(max_connections=3, writers=("127.0.0.1",))
        crowd(serving.settings.port, 20, "127.0.0.9")
        serving.wait(lambda: serving.server.statistics.troubles[Trouble.TOO_MANY] >= 17)
        connect(serving).claim()

    def test_a_place_is_free_again_behind_a_client_that_left(self, serve, connect):
        serving = serve(max_connections=1, writers=())
        first = connect(serving)
        assert first.exchange(READ) == GOOD
        assert connect(serving).is_closed()
        first.close()
        serving.wait(lambda: serving.server.connections == 0)
        assert connect(serving).exchange(READ) == GOOD

    def test_a_storm_of_resets(self, serve, connect):
        serving = serve()
        plc = connect(serving)
        plc.claim()
        for number in range(300):
            stray = connect(serving, "127.0.0.9")
            stray.send(b"\0\1\0\0\0\6\1\3\0\0\0"[: number % 12])
            stray.reset()
            if number % 30 == 0:
                assert plc.write(TRIGGER_ID, number)[0] == 16
        serving.wait(lambda: serving.server.connections == 1)
        assert plc.exchange(READ) == GOOD
        assert serving.server.writer is not None


class TestTime:
    def test_slow_requests_are_parted_from_and_others_served(self, serve, connect, eventually, caplog):
        serving = serve(frame_timeout_s=0.5)
        plc = connect(serving)
        slow = [connect(serving, "127.0.0.9") for _ in range(8)]
        for wire in slow:
            wire.send(b"\0\1\0\0\0\xfe\1")

        def drip():
            """A byte now and then, so that none of them is ever silent."""
            for wire in slow:
                with contextlib.suppress(OSError):
                    wire.send(b"\0")
            assert plc.exchange(READ) == GOOD
            return serving.server.statistics.troubles[Trouble.UNFINISHED] == 8

        eventually(drip)
        assert serving.call(lambda: serving.server.connections) == 1
        assert [line for line in caplog.messages if line.startswith("127.0.0.9:") and "no whole request" in line]

    def test_half_a_request_at_the_end_of_a_segment_has_its_own_time(self, serve, connect, eventually):
        serving = serve(frame_timeout_s=2.0)
        wire = connect(serving)
        unfinished = wire.request(READ)
        wire.send(unfinished[:5])

        def go_on():
            nonlocal unfinished
            following = wire.request(READ)
            wire.send(unfinished[5:] + following[:5])
            unfinished = following
            assert wire.receive() == (wire.transaction - 1, 1, GOOD)
            return serving.server.statistics.requests > 120

        eventually(go_on)
        assert not serving.server.statistics.troubles

    def test_the_idle_are_parted_from(self, serve, connect, eventually):
        serving = serve(idle_timeout_s=2.0)
        idle, plc = connect(serving, "127.0.0.9"), connect(serving)
        eventually(lambda: plc.exchange(READ) == GOOD and serving.server.statistics.troubles[Trouble.IDLE])
        assert idle.is_closed()
        assert plc.exchange(READ) == GOOD

    def test_a_client_that_does_not_take_its_responses(self, serve, connect, eventually):
        serving = serve(frame_timeout_s=0.5)
        deaf, plc = connect(serving, "127.0.0.9"), connect(serving)
        deaf.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        deaf.socket.setblocking(False)
        request = deaf.request(struct.pack(">BHH", 3, 128, 30))
        members = serving.wait(lambda: dict(serving.server._manager._members))
        (member,) = (member for peer, member in members.items() if peer.address == "127.0.0.9")
        servers_end = member._transport.get_extra_info("socket")
        sent = 0

        def shout():
            nonlocal sent
            with contextlib.suppress(OSError):
                sent += deaf.socket.send((request * 1000)[sent % len(request) :])
            assert plc.exchange(READ) == GOOD
            return serving.server.statistics.troubles[Trouble.SLOW_READER]

        eventually(shout)
        serving.wait(lambda: serving.server.connections == 1)
        assert serving.call(servers_end.fileno) == -1, "it does not wait for them to be taken"

    def test_a_client_that_shouts_waits_for_its_turn(self, serve, connect, monkeypatch):
        monkeypatch.setattr("plc_interface.server.connection.REQUESTS_PER_S", 50)
        serving = serve()
        loud, plc = connect(serving, "127.0.0.9"), connect(serving)
        count = 200
        began_s = time.monotonic()
        loud.send(loud.request(READ) * count)
        for _ in range(10):
            assert plc.exchange(READ) == GOOD
        assert [loud.receive()[2] for _ in range(count)] == [GOOD] * count
        assert time.monotonic() - began_s > 3.0, (
            "of four seconds at this rate, but for what is read and permitted at once"
        )

    def test_a_client_that_shouts_and_takes_nothing_ends(self, serve, connect, eventually):
        serving = serve(frame_timeout_s=0.5)
        deaf = connect(serving, "127.0.0.9")
        deaf.socket.setblocking(False)
        request, sent = deaf.request(struct.pack(">BHH", 3, 128, 30)), 0

        def shout():
            nonlocal sent
            with contextlib.suppress(OSError):
                sent += deaf.socket.send((request * 500)[sent % len(request) :])
            return serving.server.statistics.troubles[Trouble.SLOW_READER]

        eventually(shout)
        assert serving.server.statistics.requests < 20 * REQUESTS_PER_S


def test_stopping_parts_from_everybody_and_frees_the_port(serve, connect):
    serving = serve()
    plc = connect(serving)
    plc.claim()
    serving.stop_server()
    assert plc.is_closed()
    assert serving.changes[-1][0] is None
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", serving.settings.port))
    serving.stop_server()


def test_one_that_was_accepted_while_the_server_ends_is_not_admitted(serve, connect):
    serving = serve()
    serving.call(serving.server._manager.close)
    assert connect(serving).is_closed()
    assert not serving.server.statistics.troubles
    assert serving.server.statistics.connections == 0
