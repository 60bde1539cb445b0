"""The emulated controller met by other clients than the driver: ur-rtde's receive and I/O, and plain sockets."""

import asyncio
import contextlib
import itertools
import math
import socket
import struct
import subprocess
import sys
from types import SimpleNamespace

import psutil
import pytest

from station.devices.arm.probe import probe_arm
from station.devices.arm.ur import UrArm
from station.messages import arm as messages
from station.messages.message import Message
from station.twin.clock import SteadyClock
from station.twin.faults import FaultBoard
from station.twin.ur.controller import CYCLE_S, UrController
from station.twin.ur.registers import Registers
from tests.devices.arm import ur_clients

HEADER = struct.Struct(">HB")


UNTIL = """
import time
def until(condition):
    deadline = time.monotonic() + 10
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)
"""


async def run_client(source: str, *arguments: str) -> list[str]:
    """Run a client in a process of its own, because ur-rtde holds the interpreter's lock while it connects."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-c", UNTIL + source, *arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    async with asyncio.timeout(60):
        output, _ = await process.communicate()
    assert process.returncode == 0, output.decode()
    return output.decode().splitlines()


@pytest.mark.parametrize("polyscope", ["5.22", "5.25"])
def test_bare_ur_rtde_connects_moves_and_asks(bench, polyscope):
    client = """
import math, sys
from rtde_control import RTDEControlInterface
from rtde_receive import RTDEReceiveInterface
control, receive = RTDEControlInterface(sys.argv[1]), RTDEReceiveInterface(sys.argv[1])
near = lambda a, b: max(abs(x - y) for x, y in zip(a, b)) < 1e-6
there = [0.3, -1.3, 1.5, -1.5, -1.5, 0.2]
assert control.moveJ(there, 2.0, 8.0)
until(lambda: near(receive.getActualQ(), there))
pose = receive.getActualTCPPose()
pose[2] += 0.05
assert control.moveL(pose, 0.5, 2.0)
until(lambda: near(receive.getActualTCPPose(), pose))
assert near(control.getInverseKinematics(pose), receive.getActualQ())
assert control.getInverseKinematicsHasSolution(pose, there)
assert not control.getInverseKinematicsHasSolution([9, 0, 0, 0, 0, 0])
assert control.isPoseWithinSafetyLimits(pose)
assert not control.isJointsWithinSafetyLimits([9, 0, 0, 0, 0, 0])
assert control.setTcp([0, 0, 0.1, 0, 0, 0]) and near(control.getTCPOffset(), [0, 0, 0.1, 0, 0, 0])
until(lambda: near(control.getForwardKinematics(), receive.getActualTCPPose()))
assert near(control.poseTrans([1, 2, 3, 0, 0, math.pi / 2], [1, 0, 0, 0, 0, 0]), [1, 3, 3, 0, 0, math.pi / 2])
assert control.setPayload(1.5, [0, 0, 0.1])
until(lambda: receive.getPayload() == 1.5)
before = control.getAsyncOperationProgressEx()
assert control.moveJ_IK(pose, 0.5, 2.0, True)
until(lambda: control.getAsyncOperationProgressEx().isAsyncOperationRunning())
assert control.getAsyncOperationProgressEx().operationId() != before.operationId()
control.stopJ(8.0)
until(lambda: not control.getAsyncOperationProgressEx().isAsyncOperationRunning())
until(control.isSteady)
until(lambda: not any(receive.getActualQd()))
control.stopScript()
control.disconnect()
receive.disconnect()
print("done")
"""

    async def run():
        async with bench(polyscope=polyscope) as made:
            assert (await run_client(client, made.host))[-1] == "done"
            assert made.controller.script.ended_because == "the client stopped the script"

    asyncio.run(run())


def test_io_client_next_to_the_driver(bench, healthy):
    client = """
import sys
from rtde_io import RTDEIOInterface
from rtde_receive import RTDEReceiveInterface
io, receive = RTDEIOInterface(sys.argv[1]), RTDEReceiveInterface(sys.argv[1])
assert io.setSpeedSlider(0.5) and io.setStandardDigitalOut(3, True)
until(lambda: receive.getSpeedScaling() == 0.5 and receive.getDigitalOutState(3))
assert not receive.getDigitalOutState(2)
io.disconnect()
receive.disconnect()
print("done")
"""

    async def run():
        async with bench() as made, UrArm(made.settings()) as arm, healthy(arm):
            await arm.ready(20.0)
            assert (await run_client(client, made.host))[-1] == "done"
            await arm.move_to("accept")

    asyncio.run(run())


class Rtde:
    """A plain RTDE client."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    def send(self, kind: str, payload: bytes = b"") -> None:
        self._writer.write(HEADER.pack(3 + len(payload), ord(kind)) + payload)

    async def hear(self, kind: str) -> bytes:
        async with asyncio.timeout(5):
            while True:
                size, answered = HEADER.unpack(await self._reader.readexactly(3))
                payload = await self._reader.readexactly(size - 3)
                if answered == ord(kind):
                    return payload

    async def exchange(self, kind: str, payload: bytes = b"") -> bytes:
        self.send(kind, payload)
        return await self.hear(kind)

    def close(self) -> None:
        self._writer.transport.abort()


async def plain(host: str) -> Rtde:
    return Rtde(*await asyncio.open_connection(host, 30004))


def test_the_protocol_to_the_byte(bench, until, monkeypatch):
    async def run():
        async with bench() as made:
            # By its own cycles: on a busy machine they come late, and then in a row.
            began_s, controller = made.clock.now_s(), made.controller
            monkeypatch.setattr(made.clock, "now_s", lambda: began_s + CYCLE_S * controller._tick)
            client = await plain(made.host)
            assert await client.exchange("V", struct.pack(">H", 1)) == b"\x00"
            assert await client.exchange("V", struct.pack(">H", 2)) == b"\x01"
            assert struct.unpack(">4I", await client.exchange("v"))[:2] == (5, 22)
            assert await client.exchange("S") == b"\x00"
            outputs = struct.pack(">d", 500.0) + b"timestamp,actual_q,no_such_thing,output_int_register_47"
            assert await client.exchange("O", outputs) == b"\x00DOUBLE,VECTOR6D,NOT_FOUND,INT32"
            outputs = struct.pack(">d", 125.0) + b"timestamp,actual_q,"
            assert await client.exchange("O", outputs) == b"\x01DOUBLE,VECTOR6D"
            assert await client.exchange("I", b"input_int_register_48") == b"\x00NOT_FOUND"
            assert await client.exchange("I", b"input_int_register_5,input_double_register_5,") == b"\x01INT32,DOUBLE"
            assert await client.exchange("S") == b"\x01"
            stamps = []
            for _ in range(20):
                recipe, timestamp, *joints = struct.unpack(">B7d", await client.hear("U"))
                assert recipe == 1
                assert tuple(joints) == made.controller.joints_rad
                stamps.append(timestamp)
            assert [b - a for a, b in itertools.pairwise(stamps)] == pytest.approx([0.008] * 19)
            other = await plain(made.host)
            assert await other.exchange("I", b"input_int_register_5") == b"\x00IN_USE"
            client.send("U", struct.pack(">Bid", 1, 42, 2.5))
            assert await client.exchange("P") == b"\x01"
            assert made.controller.registers.input_int(5) == 42
            assert made.controller.registers.input_doubles(5, 1) == (2.5,)
            client.close()

            async def released() -> bool:
                return await other.exchange("I", b"input_int_register_5") == b"\x01INT32"

            await until(released)
            other.close()

    asyncio.run(run())


@pytest.mark.parametrize("rubbish", [b"\x00\x00\x00", b"\x00\x05U\x09\x00", b"\x00\x04V\x00", b"\x00\x06I\xff\xfe\xfd"])
def test_rubbish_costs_its_sender_the_connection_and_nobody_else(bench, rubbish):
    async def run():
        async with bench() as made:
            other = await plain(made.host)
            reader, writer = await asyncio.open_connection(made.host, 30004)
            writer.write(rubbish)
            with pytest.raises((ConnectionError, asyncio.IncompleteReadError)):
                await asyncio.wait_for(reader.readexactly(1), 5)
            writer.transport.abort()
            assert await other.exchange("V", struct.pack(">H", 2)) == b"\x01"
            other.close()

    asyncio.run(run())


@pytest.mark.parametrize("names", [ur_clients.RECORD, ur_clients.CLIENT_LIBRARY], ids=["record", "client_library"])
def test_the_outputs_that_the_makers_clients_ask_for_are_all_there(bench, names):
    async def run():
        async with bench() as made:
            client = await plain(made.host)
            kinds = await client.exchange("O", struct.pack(">d", 125.0) + names.replace(" ", "").encode())
            assert kinds[0] == 1, kinds
            assert len(kinds[1:].decode().split(",")) == names.count(",") + 1
            assert await client.exchange("S") == b"\x01"
            assert len(await client.hear("U")) > 4 * names.count(",")
            client.close()

    asyncio.run(run())


def test_outputs_that_a_client_sets_are_read_back(bench):
    client = """
import sys
from rtde_io import RTDEIOInterface
from rtde_receive import RTDEReceiveInterface
io, receive = RTDEIOInterface(sys.argv[1]), RTDEReceiveInterface(sys.argv[1])
assert io.setStandardDigitalOut(7, True) and io.setConfigurableDigitalOut(1, True) and io.setToolDigitalOut(0, True)
until(lambda: all(map(receive.getDigitalOutState, (7, 9, 16))))
assert not receive.getDigitalOutState(17)
assert io.setToolDigitalOut(0, False)
until(lambda: not receive.getDigitalOutState(16))
assert io.setAnalogOutputVoltage(0, 0.25) and io.setAnalogOutputCurrent(1, 0.5)
until(lambda: abs(receive.getStandardAnalogOutput0() - 2.5) < 1e-9)
until(lambda: abs(receive.getStandardAnalogOutput1() - 0.012) < 1e-9)
"""

    async def run():
        async with bench() as made:
            await run_client(client, made.host)

    asyncio.run(run())


HEAD_AND_SIX = (4, 48)
"""Bytes of a data package beside its values, and of one `actual_q`."""


@pytest.mark.parametrize("count", [1365, 1366])
def test_an_output_recipe_is_no_longer_than_a_package_can_be(bench, count):
    async def run():
        async with bench() as made:
            client, other = await plain(made.host), await plain(made.host)
            fits = HEAD_AND_SIX[0] + HEAD_AND_SIX[1] * count <= 65535
            outputs = struct.pack(">d", 500.0) + ",".join(["actual_q"] * count).encode()
            assert (await client.exchange("O", outputs))[:1] == bytes([fits])
            assert await client.exchange("S") == bytes([fits])
            assert await other.exchange("O", struct.pack(">d", 500.0) + b"timestamp") == b"\x01DOUBLE"
            assert await other.exchange("S") == b"\x01"
            stamps = [struct.unpack(">Bd", await other.hear("U"))[1] for _ in range(10)]
            assert stamps == sorted(set(stamps))
            if fits:
                assert len(await client.hear("U")) == 1 + HEAD_AND_SIX[1] * count
            client.close()
            other.close()

    asyncio.run(run())


@pytest.mark.parametrize("frequency_hz", [1e-320, 0.0, 0.5, -1.0, math.inf, math.nan])
def test_an_output_frequency_is_finite_and_at_least_one(bench, frequency_hz):
    async def run():
        async with bench() as made:
            client = await plain(made.host)
            assert await client.exchange("O", struct.pack(">d", frequency_hz) + b"timestamp") == b"\x00DOUBLE"
            assert await client.exchange("O", struct.pack(">d", 1.0) + b"timestamp") == b"\x01DOUBLE"
            client.close()

    asyncio.run(run())


def test_a_client_whose_package_cannot_be_made_is_cut_and_the_others_are_served(bench, until, caplog):
    async def run():
        async with bench() as made:
            client, other = await plain(made.host), await plain(made.host)
            for one, name in ((client, b"output_int_register_3"), (other, b"timestamp")):
                await one.exchange("O", struct.pack(">d", 500.0) + name)
                await one.exchange("S")
            made.controller.registers.output_int[3] = 1 << 40
            await until(lambda: len(made.controller.network.connections) == 1)
            stamps = [struct.unpack(">Bd", await other.hear("U"))[1] for _ in range(10)]
            assert stamps == sorted(set(stamps))
            client.close()
            other.close()

    asyncio.run(run())
    assert "is cut" in caplog.text


@pytest.mark.parametrize(
    ("port", "cut"),
    [
        *itertools.product((29999, 30001, 30003, 30004), ("off", "link_cut", "intermittent", "stop")),
        *itertools.product((30001, 30003), ("local_mode",)),
    ],
)
def test_connections_that_are_cut_end_without_a_word(bench, until, port, cut):
    async def run():
        complaints = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: complaints.append(context))
        async with bench() as made:
            reader, writer = await asyncio.open_connection(made.host, port)
            if port in {29999, 30001}:
                await reader.readexactly(1)
            else:
                writer.write(HEADER.pack(5, ord("V")) + b"\x00\x02")
                await until(lambda: bool(made.controller.network.connections or made.controller.network._programmers))
            if cut == "stop":
                await made.controller.stop()
            else:
                made.faults.set(cut, 0.1)
            with contextlib.suppress(ConnectionError):
                async with asyncio.timeout(5):
                    while await reader.read(4096):
                        pass
            made.faults.clear()
            writer.transport.abort()
        await asyncio.sleep(0)
        assert complaints == []

    asyncio.run(run())


@pytest.mark.parametrize(("amount", "share"), [(-1.0, 1.0), (-5.0, 1.0), (0.0, 1.0), (3.0, 0.25), (math.inf, 0.0)])
def test_the_slow_fault_leaves_a_share_of_the_speed_whatever_its_amount(host, amount, share):
    class Board(FaultBoard):
        """One that lets every amount through."""

        def amount(self, fault: str) -> float:
            return amount if fault == "slow" else 0.0

    controller = UrController(host, SteadyClock(), Board("arm"))
    assert controller.speed_scaling == share


def test_who_stops_reading_is_dropped_after_ten_seconds(bench, until):
    async def run():
        async with bench() as made:
            sock = socket.socket()
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            sock.setblocking(False)
            await asyncio.get_running_loop().sock_connect(sock, (made.host, 30004))
            reader, writer = await asyncio.open_connection(sock=sock, limit=2048)
            lazy = Rtde(reader, writer)
            names = ",".join(f"output_double_register_{i}" for i in range(48)).encode()
            await lazy.exchange("O", struct.pack(">d", 500.0) + names)
            await lazy.exchange("S")
            (connection,) = made.controller.network.connections
            await until(lambda: connection.blocked)
            assert connection in made.controller.network.connections
            made.clock.skip(9.0)
            await asyncio.sleep(0.05)
            assert connection in made.controller.network.connections
            made.clock.skip(1.5)
            await until(lambda: not made.controller.network.connections)
            lazy.close()

    asyncio.run(run())


def test_the_primary_stream_tells_version_and_robot_mode(bench):
    async def run():
        async with bench() as made:
            reader, writer = await asyncio.open_connection(made.host, 30001)

            async def message() -> bytes:
                async with asyncio.timeout(5):
                    (size,) = struct.unpack(">i", await reader.readexactly(4))
                    return await reader.readexactly(size - 4)

            version = await message()
            kind, _, _, subtype, length = struct.unpack_from(">BQbbb", version)
            assert (kind, subtype) == (20, 3)
            assert struct.unpack_from(">BB", version, 12 + length) == (5, 22)
            state = await message()
            assert state[0] == 16
            size, sub = struct.unpack_from(">iB", state, 1)
            assert (size, sub) == (47, 0)
            flags = struct.unpack_from(">7?B", state, 14)
            assert flags == (True, True, True, False, False, False, False, 7)
            for fault, place, expected in (
                ("protective_stop", 4, (True, True, True, False, True, False, False, 7)),
                ("emergency_stop", 3, (True, True, False, True, False, False, False, 3)),
            ):
                made.faults.set(fault)
                for _ in range(30):
                    flags = struct.unpack_from(">7?B", await message(), 14)
                    if flags[place]:
                        break
                assert flags == expected
            writer.transport.abort()

    asyncio.run(run())


def test_the_dashboard_answers_line_by_line(bench, until):
    async def run():
        async with bench() as made:
            reader, writer = await asyncio.open_connection(made.host, 29999)

            async def query(line: str) -> str:
                writer.write(line.encode() + b"\n")
                return (await asyncio.wait_for(reader.readline(), 5)).decode().strip()

            assert (await reader.readline()).startswith(b"Connected: Universal Robots Dashboard Server")
            assert await query("robotmode") == "Robotmode: RUNNING"
            assert await query("ROBOTMODE ") == "Robotmode: RUNNING"
            assert (await query("dance")).startswith("could not understand")
            made.faults.set("protective_stop")
            made.faults.clear("protective_stop")

            async def stopped() -> bool:
                return await query("safetystatus") == "Safetystatus: PROTECTIVE_STOP"

            await until(stopped)
            assert (await query("unlock protective stop")).startswith("Cannot unlock")
            made.clock.skip(5.0)
            assert await query("unlock protective stop") == "Protective stop releasing"
            assert await query("safetystatus") == "Safetystatus: NORMAL"
            for line, answer in ur_clients.DASHBOARD.items():
                assert await query(line) == answer
            assert await reader.read() == b""
            writer.transport.abort()

    asyncio.run(run())


@pytest.mark.parametrize(
    ("fault", "verdicts", "message"),
    [
        (None, ["ok", "ok", "ok"], messages.CHECK_REMOTE),
        ("local_mode", ["fault", "ok", "ok"], messages.REMEDY_LOCAL_CONTROL),
        ("emergency_stop", ["fault", "ok", "ok"], messages.REMEDY_EMERGENCY_STOP),
        ("protective_stop", ["fault", "ok", "ok"], messages.REMEDY_PROTECTIVE_STOP),
        ("safeguard", ["fault", "ok", "ok"], messages.REMEDY_SAFEGUARD_STOP),
        ("registers_in_use", ["ok", "warning", "ok"], messages.REMEDY_REGISTERS_IN_USE),
        ("rtde_silent", ["ok", "fault", "ok"], messages.CHECK_RTDE_LATE),
        ("stuck", ["ok", "fault", "ok"], messages.CHECK_RTDE_FROZEN),
        ("delayed", ["ok", "fault", "ok"], messages.CHECK_RTDE_FROZEN),
        ("link_cut", ["fault"], messages.DASHBOARD_ABSENT),
        ("garbage", ["fault"], messages.REMEDY_HOST),
    ],
)
def test_the_device_check_says_what_was_found_and_what_to_do(bench, fault, verdicts, message):
    async def run():
        async with bench() as made:
            if fault is not None:
                made.faults.set(fault, 0.32)
                await asyncio.sleep(0.1)
            findings = await probe_arm(made.settings())
            assert [finding.verdict for finding in findings] == verdicts
            found = [each for finding in findings for each in (finding.found, finding.remedy) if each is not None]
            found += [each for one in found for each in one.parameters.values() if isinstance(each, Message)]
            assert message.id in {each.id for each in found}
            assert all((finding.remedy is None) == (finding.verdict == "ok") for finding in findings)

    asyncio.run(run())


@pytest.mark.parametrize(
    ("answered_s", "verdict"), [((0.0, 0.5, 0.51, 0.9, 1.3), "ok"), ((0.0, 0.4, 0.8, 1.2, 1.6), "fault")]
)
def test_a_pause_at_one_request_is_no_late_stream(bench, monkeypatch, answered_s, verdict):
    async def run():
        async with bench() as made:
            monkeypatch.setattr("station.devices.arm.probe.time", SimpleNamespace(monotonic=iter(answered_s).__next__))
            findings = await probe_arm(made.settings())
            assert [finding.verdict for finding in findings] == ["ok", verdict, "ok"]

    asyncio.run(run())


def test_the_device_check_claims_nothing_that_the_station_needs(bench, healthy, monkeypatch):
    async def run():
        async with bench() as made, UrArm(made.settings()) as arm, healthy(arm):
            await arm.ready(20.0)
            held, claimed = set(made.controller.registers._owners), []
            claim = Registers.claim

            def listening(registers, name, owner, *, fieldbus_on):
                claimed.append(name)
                return claim(registers, name, owner, fieldbus_on=fieldbus_on)

            monkeypatch.setattr(Registers, "claim", listening)
            findings = await probe_arm(made.settings())
            assert [finding.verdict for finding in findings] == ["ok", "ok", "ok"]
            assert claimed
            assert held
            assert not held & set(claimed)
            assert (await arm.state()).fault is None

    asyncio.run(run())


def test_the_device_check_cuts_what_a_peer_says_too_much(bench):
    async def run():
        async with bench() as made:
            made.controller.serial_number = "\x1b[31m" + "9" * 3000
            findings = await probe_arm(made.settings())
            found = str(findings[0].found)
            assert "9" * 100 in found
            assert len(found) < 400
            assert "\x1b" not in found

    asyncio.run(run())


@pytest.mark.timeout(400)
def test_a_hundred_connections_and_drops_leave_nothing_behind(bench, until):
    """Four controllers at a time, because most of a connection is waiting; threads and processes the fixture counts."""

    async def cycle(made) -> None:
        async with UrArm(made.settings(stale_after_s=0.3)) as arm:
            await arm.ready(60.0)
            made.controller.network.cut()

            async def dropped() -> bool:
                return (await arm.state()).fault is not None

            await until(dropped)

    before = set(psutil.Process().children())

    async def run():
        async with bench() as one, bench() as two, bench() as three, bench() as four:
            descriptors = []
            for _ in range(25):
                await asyncio.gather(*(cycle(made) for made in (one, two, three, four)))
                descriptors.append(psutil.Process().num_fds())
            assert max(descriptors[5:]) <= descriptors[4]
            assert not any(made.controller.network.connections for made in (one, two, three, four))
            assert not set(psutil.Process().children()) - before

    asyncio.run(run())
