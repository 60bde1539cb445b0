"""A process that a busy machine starts late: no connection is taken for hung before there is a process to make it."""

import asyncio
import contextlib
from typing import Any

from station.devices.arm import link
from station.devices.arm.messages import Outcome
from station.settings.arm import ArmSettings

LIMIT_S = 0.5


class Late:
    """Answers nothing until it has started, and then all at once."""

    def __init__(self):
        self.starting = asyncio.create_task(asyncio.sleep(1.5 * LIMIT_S))

    async def request(self, _request, _reply, *, deadline_s):
        async with asyncio.timeout(deadline_s):
            await asyncio.shield(self.starting)
        return Outcome(done=True)


@contextlib.asynccontextmanager
async def dashboard(_host):
    yield None


def test_the_limit_of_a_connection_counts_from_the_process_start(monkeypatch):
    async def run():
        late: Any = Late()

        async def spawn(_host, _frequency_hz):
            return late

        monkeypatch.setattr(link, "dashboard", dashboard)
        monkeypatch.setattr(link.ArmProcess, "spawn", spawn)
        assert await link.ArmLink(ArmSettings(constructor_limit_s=LIMIT_S))._connect() is late

    asyncio.run(run())
