"""A command that waits: for the one before, or for the disk."""

import asyncio
import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest

from station.channel.line import Command, CommandName
from station.devices.arm.faults import ArmCause, ArmFault
from station.inspection.cycle import Event
from station.inspection.states import State
from station.messages import commands as messages
from station.messages.arm import EMERGENCY_STOP
from station.runtime.production import plc_commands
from station.runtime.production.plc_commands import PlcCommands

RESET = Command(command=CommandName.RESET, argument=0)


def made(state_files: Any = None):
    """Return commands of a station that is idle, without devices."""
    service: Any = SimpleNamespace(
        state=State.IDLE, active=None, ending=False, manual_activity=None, allow=lambda: None,
        alarms=SimpleNamespace(alarms=SimpleNamespace(known={})),
        runner=SimpleNamespace(taken=lambda: asyncio.sleep(0)),
    )  # fmt: skip
    audit: Any = SimpleNamespace(log=lambda *_: None)
    devices: Any = SimpleNamespace(faults={}, active_stop=None, power_missing=None, program_stopped=False)
    nothing: Any = None
    return PlcCommands(service, devices, nothing, nothing, state_files, audit)


def test_a_command_that_waited_to_its_deadline_is_not_begun_afterwards(monkeypatch):
    resets = []

    async def reset(by):
        resets.append(by)

    async def main():
        commands = made()
        monkeypatch.setattr(commands, "_reset", reset)
        monkeypatch.setattr(plc_commands, "DEADLINE_S", 0.05)
        async with commands._turn:
            waiting = asyncio.create_task(commands.execute(RESET))
            await asyncio.sleep(0.3)
        done = await waiting
        assert not done.done
        assert done.why is not None
        assert (done.why.id, resets) == (messages.TOO_SLOW.id, [])
        monkeypatch.setattr(plc_commands, "DEADLINE_S", 25.0)
        assert (await commands.execute(RESET)).done
        assert len(resets) == 1
        monkeypatch.setattr(plc_commands, "is_expired", lambda: True)
        assert not (await commands.execute(RESET)).done, "the PLC waits no longer than its own setting"
        assert (await commands.execute(RESET, ("anna", "operator"))).done
        assert len(resets) == 2

    asyncio.run(main())


def test_a_stop_is_what_the_file_has_also_where_the_disk_outlasts_the_reset_before(monkeypatch):
    started, free, written = threading.Event(), threading.Event(), []

    def write(_name, data):
        if not started.is_set():
            started.set()
            assert free.wait(30)
        written.append(data)
        return True

    async def main():
        commands = made(SimpleNamespace(write=write))
        monkeypatch.setattr(plc_commands, "DEADLINE_S", 0.05)
        assert not (await commands.execute(RESET)).done
        commands._stop_wanted = True  # as a person's stop does first
        storing = asyncio.create_task(commands._store_stop())
        await asyncio.sleep(0.1)
        free.set()
        assert await storing

    asyncio.run(main())
    assert written == [b"no", b"yes"]


class Station:
    """Service and runner in one state, which note what is posted; nothing moves."""

    def __init__(self, state: State) -> None:
        self.state, self.entered_s, self.stopped_s, self.posted = state, 0.0, 0.0, list[Event]()
        self.active, self.manual_activity = None, None
        self.ending = self.stopped_by_person = False
        self.runner = self.alarms = self

    def stop(self) -> None:
        self.stopped_by_person = True

    def allow(self) -> None:
        self.stopped_by_person = False

    def request_reset(self) -> None:
        pass

    def post(self, event: Event, _why: object = None) -> None:
        self.posted.append(event)
        self.state = State.IDLE

    async def taken(self) -> None:
        pass

    async def until(self, _wanted: object) -> State:
        return self.state

    async def end_manual(self) -> None:
        pass


class SlowDisk:
    """State files whose writes begin in their order, and end when they are freed."""

    def __init__(self) -> None:
        self.started, self.free = (threading.Event(), threading.Event()), (threading.Event(), threading.Event())
        self._writes = 0

    def write(self, _name: str, _data: bytes) -> bool:
        number, self._writes = self._writes, self._writes + 1
        self.started[number].set()
        return self.free[number].wait(30)


def resetting(state: State):
    """Return commands, the station and the disk of a reset that is ordered in a state."""
    commands, station, disk = made(), Station(state), SlowDisk()
    commands._service, commands._state_files = station, disk  # type: ignore[assignment]
    commands._devices.confirm_clear = lambda: None
    commands._devices.end_recovery = station.taken
    return commands, station, disk


def test_nothing_begins_by_a_reset_that_waited_for_the_disk_while_a_person_stopped_the_station():
    """The reset's write ends first, and the stop's is still to come."""

    async def main():
        commands, station, disk = resetting(State.STOPPED)
        started = asyncio.create_task(commands._reset(("anna", "operator")))
        assert await asyncio.to_thread(disk.started[0].wait, 30)
        stopping = asyncio.create_task(commands.stop())
        await asyncio.sleep(0)
        disk.free[0].set()
        assert await started == messages.STOPPED_MEANWHILE()
        assert station.posted == []
        disk.free[1].set()
        assert await stopping is None
        assert station.stopped_by_person

    asyncio.run(main())


def emergency_stop(station: Station, devices: Any) -> None:
    devices.active_stop = ArmFault(ArmCause.EMERGENCY_STOP, EMERGENCY_STOP())


def released_emergency_stop(station: Station, devices: Any) -> None:
    station.stopped_s = time.monotonic()  # in LATCHED a further stop enters no state


def stop_on_the_pendant(station: Station, devices: Any) -> None:
    devices.program_stopped = True


@pytest.mark.parametrize("happens", [emergency_stop, released_emergency_stop, stop_on_the_pendant])
def test_a_reset_confirms_no_stop_that_came_while_it_waited_for_the_disk(happens):
    async def main():
        commands, station, disk = resetting(State.LATCHED)
        started = asyncio.create_task(commands._reset(("anna", "operator")))
        assert await asyncio.to_thread(disk.started[0].wait, 30)
        happens(station, commands._devices)
        disk.free[0].set()
        assert await started is not None
        assert station.posted == []

    asyncio.run(main())


def test_a_reset_goes_by_the_state_that_the_station_came_to_while_it_waited_for_the_disk():
    """A device came back: the station is stopped by now, and nothing but this reset leads on."""

    async def main():
        commands, station, disk = resetting(State.HELD)
        started = asyncio.create_task(commands._reset(("anna", "operator")))
        assert await asyncio.to_thread(disk.started[0].wait, 30)
        station.state, station.entered_s = State.STOPPED, time.monotonic()
        disk.free[0].set()
        assert await started is None
        assert station.posted == [Event.RESET]

    asyncio.run(main())
