"""The station's driver over each wire, with everything wrong that can be."""

import asyncio
import contextlib
import socket
import subprocess
import sys
import termios
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.devices.gripper import robotiq
from station.devices.gripper.errors import (
    FAULTS,
    GripperEmergencyStopError,
    GripperError,
    GripperFaultError,
    GripperLinkLostError,
    GripperProtocolError,
    GripperSilentError,
    GripperTimeoutError,
    GripperUnreachableError,
)
from station.devices.gripper.interface import ObjectState
from station.devices.gripper.modbus_rtu import ModbusRtuLink
from station.devices.gripper.robotiq import make_gripper
from station.devices.gripper.urcap import UrcapLink
from station.messages import gripper as messages
from station.messages.message import Message
from station.settings.gripper import GripperSettings, ModbusRtuSettings, UrcapSettings
from station.twin.robotiq.load import NoLoad, Spring
from station.twin.robotiq.registers import Command
from station.twin.robotiq.rtu import framed
from tests.eventually import until

OnWire = Callable[..., Any]
DIGIT_MM = 32.0


async def under_way(rig: Any) -> asyncio.Task[Any]:
    """A slow closing move that has started."""
    moving = asyncio.create_task(rig.driver.move_to_width(0.0, 20.0, 20.0))
    await rig.until(lambda: rig.twin.status().go_to)
    return moving


@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("over_temperature", 0x8),
        ("under_voltage", 0xA),
        ("automatic_release", 0xB),
        ("internal_fault", 0xC),
        ("overcurrent", 0xE),
    ],
)
def test_each_fault_ends_a_move_by_its_name_and_the_fingers_stay(on_wire: OnWire, fault: str, code: int):
    async def scenario(rig: Any) -> None:
        moving = await under_way(rig)
        rig.clock.skip(1.0)
        rig.twin.status()
        rig.faults.set(fault)
        with pytest.raises(GripperFaultError) as caught:
            await moving
        assert caught.value.fault_code == code
        assert caught.value.code == FAULTS[code].name
        assert caught.value.message == messages.FAULT(cause=caught.value.cause, remedy=FAULTS[code].remedy)
        assert not rig.twin.status().go_to
        assert (await rig.driver.read()).fault_code == code
        rig.faults.clear()
        rig.clock.skip(20.0)
        before_mm = rig.twin.opening_mm(rig.clock.now_s())
        rig.clock.skip(5.0)
        assert rig.twin.opening_mm(rig.clock.now_s()) == before_mm
        await rig.activate()
        assert (await rig.driver.open()).reading.object_state == ObjectState.AT_POSITION

    on_wire(scenario)


def test_after_a_loss_of_power_the_position_of_before_is_known_and_the_reported_one_is_not_believed(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.load(Spring(free_mm=DIGIT_MM + 44.0, stiffness_n_per_mm=1.5))
        assert rig.driver.known_width_mm is None, "nothing was read yet"
        held = await rig.driver.move_to_width(40.0, 150.0, 20.0)
        rig.faults.set("power_cut")
        rig.faults.clear()
        reading = await rig.driver.read()
        assert not reading.active
        assert reading.width_mm > rig.driver.max_width_mm
        assert rig.driver.known_width_mm == held.width_mm
        rig.load(NoLoad())
        assert (await rig.driver.activate()).active
        assert rig.driver.known_width_mm >= rig.driver.max_width_mm
        moving = await under_way(rig)
        rig.faults.set("off")
        with pytest.raises(GripperError):
            await moving
        assert rig.driver.known_width_mm is None, "they were sent elsewhere, and no more is known"

    on_wire(scenario)


def test_a_failed_activation_is_told_by_its_name(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.twin.write(Command())
        rig.faults.set("activation_fault")
        with pytest.raises(GripperFaultError) as caught:
            await rig.driver.activate()
        assert caught.value.fault_code == 0xD
        assert caught.value.remedy == messages.REMEDY_BLOCKED()

    on_wire(scenario)


def test_an_activation_that_never_ends_is_given_up(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.twin.write(Command())
        rig.faults.set("slow", 100.0)
        with pytest.raises(GripperTimeoutError) as caught:
            await rig.driver.activate()
        assert caught.value.cause.parameters["step"] == messages.STEP_ACTIVATION()

    on_wire(scenario, activation_timeout_s=1.0, answer_timeout_s=0.5)


def test_a_passing_report_of_no_communication_is_forgiven_and_a_lasting_one_is_not(
    on_wire: OnWire, monkeypatch: pytest.MonkeyPatch
):
    now_s = 100.0  # the driver's time: what passes for a driver on a busy machine would last by the machine's

    async def scenario(rig: Any) -> None:
        nonlocal now_s
        monkeypatch.setattr(robotiq, "time", SimpleNamespace(monotonic=lambda: now_s))
        for _ in range(3):
            rig.faults.set("no_communication")
            assert (await rig.driver.open()).reading.fault_code == 9
            now_s += 0.4
            assert (await rig.driver.open()).reading.fault_code == 9
            rig.faults.clear()
            assert (await rig.driver.open()).reading.fault_code == 0
        rig.faults.set("no_communication")
        assert (await rig.driver.open()).reading.fault_code == 9
        now_s += 0.6
        with pytest.raises(GripperFaultError) as caught:
            await rig.driver.open()
        assert caught.value.code == "no_communication"

    on_wire(scenario)


@pytest.mark.parametrize("fault", ["no_communication", "over_temperature"])
def test_a_passing_fault_is_no_reason_to_travel_for_an_activation(on_wire: OnWire, fault: str):
    async def scenario(rig: Any) -> None:
        rig.faults.set(fault)
        before = rig.twin.command
        assert (await rig.driver.activate()).fault_code
        assert rig.twin.command == before

    on_wire(scenario)


def test_an_emergency_stop_is_told_as_such(on: OnWire):
    async def scenario(rig: Any) -> None:
        moving = await under_way(rig)
        rig.faults.set("emergency_stopped")
        with pytest.raises(GripperEmergencyStopError):
            await moving
        with pytest.raises(GripperEmergencyStopError):
            await rig.driver.read()

    on("urcap", scenario)


def test_over_modbus_a_gripper_that_stands_still_is_a_time_out(on: OnWire):
    async def scenario(rig: Any) -> None:
        moving = asyncio.create_task(rig.driver.move_to_width(40.0, 150.0, 20.0))
        await rig.until(lambda: rig.twin.status().go_to)
        rig.clock.hold()  # where they are on the way: on a busy machine they may arrive before this goes on
        rig.faults.set("emergency_stopped")
        rig.twin.status()
        rig.clock.go_on()
        with pytest.raises(GripperTimeoutError):
            await moving

    on("rtu over tcp", scenario, move_margin_s=0.4)


@pytest.mark.parametrize(("fault", "amount"), [("stuck", 1.0), ("wrong", 9.0), ("slow", 50.0)])
def test_what_answers_but_does_not_do_it_is_given_up_in_time(on_wire: OnWire, fault: str, amount: float):
    async def scenario(rig: Any) -> None:
        rig.faults.set(fault, amount)
        began_s = time.monotonic()
        with pytest.raises(GripperTimeoutError) as caught:
            await rig.driver.move_to_width(45.0, 100.0, 20.0)
        assert caught.value.cause.id == messages.LATE_AT.id
        assert isinstance(caught.value.cause.parameters["state"], Message)
        assert time.monotonic() - began_s < 5.0
        rig.faults.clear()
        assert (await rig.driver.move_to_width(45.0, 100.0, 20.0)).width_mm == pytest.approx(45.0, abs=0.2)

    on_wire(scenario, move_margin_s=1.0)


def test_garbage_is_told_from_silence(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.faults.set("garbage")
        with pytest.raises(GripperProtocolError):
            await rig.driver.read()
        rig.faults.clear()
        assert (await rig.driver.read()).active

    on_wire(scenario)


def test_a_late_answer_is_silence_and_never_taken_for_the_next(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.faults.set("delayed", 3.0)
        with pytest.raises(GripperSilentError):
            await rig.driver.read()
        rig.faults.clear()
        rig.twin.write(Command(activate=True, go_to=True, position=99))
        assert (await rig.driver.link.status()).echo == 99

    on_wire(scenario)


def test_an_answer_to_a_cancelled_question_is_not_taken_for_the_next(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.faults.set("delayed", 0.1)
        reading = asyncio.create_task(rig.driver.read())
        await asyncio.sleep(0.05)  # in mid-exchange, though no moment may do harm
        reading.cancel()
        rig.faults.clear()
        with pytest.raises(asyncio.CancelledError):
            await reading
        rig.twin.write(Command(activate=True, go_to=True, position=99))
        for _ in range(3):
            assert (await rig.driver.link.status()).echo == 99

    on_wire(scenario)


Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Coroutine[Any, Any, None]]


@contextlib.asynccontextmanager
async def urcap(serve: Serve) -> AsyncIterator[UrcapSettings]:
    """A URCap that a test writes."""

    async def session(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.closing(writer), contextlib.suppress(ConnectionError):
            await serve(reader, writer)

    async with await asyncio.start_server(session, "127.0.0.1", 0) as server:
        yield UrcapSettings(host="127.0.0.1", port=server.sockets[0].getsockname()[1])


def test_a_halt_is_carried_out_after_the_command_that_was_cancelled():
    """The URCap may carry out what it has read a little later, and what comes over another connection at once."""

    async def scenario() -> None:
        received, carried_out = asyncio.Event(), list[str]()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := (await reader.readline()).decode().strip():
                if line.startswith("GET"):
                    writer.write(f"{line[4:]} {3 if line == 'GET STA' else 0}\n".encode())
                    continue
                if line.endswith("GTO 1"):
                    received.set()
                    await asyncio.sleep(0.1)
                carried_out.append(line[-5:])
                writer.write(b"ack")

        async with urcap(serve) as wire:
            gripper = make_gripper(GripperSettings(answer_timeout_s=5.0, urcap=wire))
            moving = asyncio.create_task(gripper.move_to_width(20.0, 50.0, 20.0))
            await received.wait()
            moving.cancel()
            with pytest.raises(asyncio.CancelledError):
                await moving
            await until(lambda: len(carried_out) == 2)
            assert carried_out == ["GTO 1", "GTO 0"]
            await gripper.close()

    asyncio.run(scenario())


def test_an_exchange_that_is_cancelled_twice_ends_at_once_and_the_next_has_a_connection_of_its_own():
    async def scenario() -> None:
        requests = list[bytes]()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while request := await reader.readline():
                requests.append(request)
                if len(requests) > 1:
                    writer.write(b"ack")

        async with urcap(serve) as wire:
            link = UrcapLink(wire, 600.0)
            first = asyncio.create_task(link.halt())
            await until(lambda: requests)
            first.cancel()
            await asyncio.sleep(0)
            first.cancel()
            with pytest.raises(asyncio.CancelledError):
                await first
            await link.halt()
            await link.close()

    asyncio.run(scenario())


def test_a_request_that_was_given_up_is_not_sent_on():
    """A reset in place of an end: with it the kernel discards what it would send where a cut network comes back."""

    async def scenario() -> None:
        ends: asyncio.Future[BaseException | bytes] = asyncio.get_running_loop().create_future()

        async def mute(reader: asyncio.StreamReader, _writer: asyncio.StreamWriter) -> None:
            await reader.readline()
            ends.set_result((await asyncio.gather(reader.read(), return_exceptions=True))[0])

        async with urcap(mute) as wire:
            with pytest.raises(GripperSilentError):
                await UrcapLink(wire, 0.1).halt()
            assert isinstance(await ends, ConnectionResetError)

    asyncio.run(scenario())


def test_a_short_delay_is_borne(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        rig.faults.set("delayed", 0.02)
        assert (await rig.driver.move_to_width(51.0, 100.0, 20.0)).width_mm == pytest.approx(51.0, abs=0.2)

    on_wire(scenario)


def test_a_link_cut_in_mid_move_is_an_error_at_once_and_nothing_moves_by_itself_after(on_wire: OnWire, wire: str):
    async def scenario(rig: Any) -> None:
        moving = await under_way(rig)
        rig.faults.set("off")
        with pytest.raises((GripperLinkLostError, GripperSilentError) if wire == "serial" else GripperLinkLostError):
            await moving
        with pytest.raises(GripperSilentError if wire == "serial" else GripperUnreachableError):
            await rig.driver.read()
        rig.faults.clear()
        rig.twin.write(Command(activate=True))
        reading = await reached(rig)
        rig.clock.skip(5.0)
        assert (await rig.driver.read()).position_count == reading.position_count
        assert (await rig.driver.open()).reading.object_state == ObjectState.AT_POSITION

    on_wire(scenario, answer_timeout_s=0.5)


async def reached(rig: Any) -> Any:
    """The first reading that comes through; the scenario's own limit is the deadline."""
    while True:
        try:
            return await rig.driver.read()
        except GripperError:
            await asyncio.sleep(0.01)


def test_what_comes_and_goes_gives_errors_and_then_readings(on_wire: OnWire):
    async def scenario(rig: Any) -> None:
        # There for longer than the driver waits for an answer and for a silent line together: with a period of just
        # these two, every request of the driver would fall into a silence.
        rig.faults.set("intermittent", 4.0)
        seen = set()
        while seen != {True, False}:
            try:
                seen.add((await rig.driver.read()).active)
            except GripperError:
                seen.add(False)
            await asyncio.sleep(0.01)

    on_wire(scenario, answer_timeout_s=0.5)


@pytest.mark.parametrize(
    "wire_settings",
    [
        GripperSettings(urcap=UrcapSettings(host="127.0.0.1", port=1)),
        GripperSettings(driver="modbus_rtu", modbus_rtu=ModbusRtuSettings(line="tcp", host="127.0.0.1", port=1)),
        GripperSettings(driver="modbus_rtu", modbus_rtu=ModbusRtuSettings(serial_port="/dev/no-such-adapter")),
    ],
    ids=["urcap", "rtu over tcp", "serial"],
)
def test_nobody_there_is_told_with_the_place(wire_settings: GripperSettings):
    gripper = make_gripper(wire_settings)
    with pytest.raises(GripperUnreachableError, match=r"127\.0\.0\.1:1|no-such-adapter"):
        asyncio.run(gripper.read())


def test_an_adapter_pulled_out_is_an_error(on: OnWire):
    async def scenario(rig: Any) -> None:
        moving = await under_way(rig)
        await rig.server.stop()
        with pytest.raises(GripperError):
            await moving

    on("serial", scenario)


@settings(max_examples=40, deadline=None)
@given(reply=st.binary(min_size=1, max_size=80), rtu=st.booleans())
def test_no_answer_whatsoever_does_more_than_raise_a_gripper_error(reply: bytes, rtu: bool):
    unseen: list[Any] = []

    async def scenario() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: unseen.append(context))

        async def mad(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            # The driver may hang up while the madman still talks, or the loop end before its end has come.
            with contextlib.closing(writer), contextlib.suppress(ConnectionError):
                while await reader.read(100):
                    writer.write(reply)

        server = await asyncio.start_server(mad, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        address = {"host": "127.0.0.1", "port": port}
        wire: dict[str, Any] = (
            {"driver": "modbus_rtu", "modbus_rtu": ModbusRtuSettings(line="tcp", **address)}
            if rtu
            else {"urcap": UrcapSettings(**address)}
        )
        gripper = make_gripper(GripperSettings(answer_timeout_s=0.02, **wire))
        try:
            with pytest.raises(GripperError):
                await gripper.read()
            with pytest.raises(GripperError):
                await gripper.open()
        finally:
            await gripper.close()
            server.close()
            await asyncio.sleep(0)

    asyncio.run(scenario())
    assert not unseen


def test_an_answer_to_another_question_is_refused():
    status = framed(bytes.fromhex("09 04 06 31 00 00 00 03 00"))

    async def scenario() -> None:
        async def deaf(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            with contextlib.closing(writer):
                while await reader.read(100):
                    writer.write(status)

        server = await asyncio.start_server(deaf, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        wire = ModbusRtuSettings(line="tcp", host="127.0.0.1", port=port)
        gripper = make_gripper(GripperSettings(driver="modbus_rtu", modbus_rtu=wire))
        assert (await gripper.read()).active
        with pytest.raises(GripperProtocolError) as caught:
            await gripper.move_to_width(40.0, 50.0, 20.0)
        assert caught.value.cause == messages.WRONG_FUNCTION(place=gripper.link.place, found=4, expected=16)
        await gripper.close()
        server.close()
        await asyncio.sleep(0.01)

    asyncio.run(scenario())


@pytest.mark.parametrize("lie", ["STA 4", "GTO 2", "OBJ 7", "POS 300", "PRE -1", "FLT x"])
def test_a_value_that_a_variable_cannot_have_is_refused(lie: str):
    async def scenario() -> None:
        async def mad(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            while line := await reader.readline():
                name = line.decode().split()[1]
                writer.write(f"{lie if lie.startswith(name) else f'{name} 0'}\n".encode())

        async with urcap(mad) as wire:
            # An answer comes to every question: no limit is to pass, also where this is held up between the two.
            with pytest.raises(GripperProtocolError) as caught:
                await UrcapLink(wire, 5.0).status()
            assert lie in str(caught.value.cause.parameters["answer"])

    asyncio.run(scenario())


@pytest.mark.parametrize("answers", [False, True])
def test_devices_check_of_a_dead_gripper_prints_the_stations_own_line_alone(tmp_path, answers):
    with socket.socket() as dead:
        dead.bind(("127.0.0.1", 0))
        if answers:
            dead.listen()
        wire = f"{{line: tcp, host: 127.0.0.1, port: {dead.getsockname()[1]}}}"
        configuration = tmp_path / "station.yaml"
        configuration.write_text(
            "arm: {host: 127.0.0.9}\ncamera: {open_deadline_s: 0.2, twin: {port: 1}}\n"
            f"gripper: {{driver: modbus_rtu, answer_timeout_s: 0.2, modbus_rtu: {wire}}}\n"
        )
        command = [sys.executable, "-m", "station", "devices", "check", "--config", str(configuration)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 1
    assert "Modbus RTU unit 9" in done.stdout
    [line] = done.stderr.splitlines()
    assert "not usable" in line


def test_a_serial_port_that_goes_away_while_it_is_opened_is_out_of_reach(monkeypatch: pytest.MonkeyPatch):
    """pyserial flushes what it has just opened, and hands the error of the system call on as it is."""
    closed = list[str]()

    async def connect() -> bool:
        raise termios.error(5, "Input/output error")

    client = SimpleNamespace(connect=connect, close=lambda: closed.append("client"))
    monkeypatch.setattr(ModbusRtuLink, "_make", lambda _: client)
    link = ModbusRtuLink(ModbusRtuSettings(line="serial", serial_port="/dev/ttyUSB0"), 0.1)
    with pytest.raises(GripperUnreachableError):
        asyncio.run(link.status())
    assert closed == ["client"]
