"""The deadline of a command that waits for the one before."""

import asyncio
from types import SimpleNamespace
from typing import Any

from station.channel.line import Command, CommandName
from station.inspection.states import State
from station.messages import commands as messages
from station.runtime.production import plc_commands
from station.runtime.production.plc_commands import PlcCommands

RESET = Command(command=CommandName.RESET, argument=0)


def test_a_command_that_waited_to_its_deadline_is_not_begun_afterwards(monkeypatch):
    alarms = SimpleNamespace(alarms=SimpleNamespace(known={}))
    service: Any = SimpleNamespace(state=State.IDLE, alarms=alarms, active=None)
    observability: Any = SimpleNamespace(metrics=None, audit=SimpleNamespace(log=lambda *_: None))
    nothing: Any = SimpleNamespace(faults={})
    begun = []

    async def reset(by):
        begun.append(by)

    async def main():
        commands = PlcCommands(service, nothing, nothing, nothing, nothing, observability)
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

    asyncio.run(main())
