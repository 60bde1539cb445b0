"""The deadline of a command that waits for the one before."""

import asyncio
import threading
from types import SimpleNamespace
from typing import Any

from station.channel.line import Command, CommandName
from station.inspection.states import State
from station.messages import commands as messages
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
    observability: Any = SimpleNamespace(metrics=None, audit=SimpleNamespace(log=lambda *_: None))
    devices: Any = SimpleNamespace(faults={}, active_stop=None, power_missing=None)
    nothing: Any = None
    return PlcCommands(service, devices, nothing, nothing, state_files, observability)


def test_a_command_that_waited_to_its_deadline_is_not_begun_afterwards(monkeypatch):
    begun = []

    async def reset(by):
        begun.append(by)

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
        assert (done.why.id, begun) == (messages.TOO_SLOW.id, [])
        monkeypatch.setattr(plc_commands, "DEADLINE_S", 25.0)
        assert (await commands.execute(RESET)).done
        assert len(begun) == 1
        monkeypatch.setattr(plc_commands, "is_expired", lambda: True)
        assert not (await commands.execute(RESET)).done, "the PLC waits no longer than its own setting"
        assert (await commands.execute(RESET, ("anna", "operator"))).done
        assert len(begun) == 2

    asyncio.run(main())


def test_a_stop_is_what_the_file_has_also_where_the_disk_outlasts_the_reset_before(monkeypatch):
    begun, free, written = threading.Event(), threading.Event(), []

    def write(_name, data):
        if not begun.is_set():
            begun.set()
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
