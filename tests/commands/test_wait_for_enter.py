"""The request for a person's Enter, which an Enter from before it does not answer."""

import asyncio
import os
import pty

import pytest

from station.commands.calibration_rig import wait_for_enter


@pytest.fixture
def terminal(monkeypatch):
    """The end of a terminal at which a person types; the other end is the input."""
    leader, follower = pty.openpty()
    with os.fdopen(follower, encoding="utf-8") as keyboard:
        monkeypatch.setattr("sys.stdin", keyboard)
        yield leader
    os.close(leader)


def test_an_enter_from_before_the_request_is_no_answer_to_it(terminal, capsys):
    async def scenario():
        os.write(terminal, b"before\n")
        # The terminal has it: its echo is there.
        assert await asyncio.to_thread(os.read, terminal, 100) == b"before\r\n"
        waiting = asyncio.create_task(wait_for_enter("take your hands away"))
        while "take your hands away" not in capsys.readouterr().out:
            await asyncio.sleep(0)
        for _ in range(10):
            await asyncio.sleep(0)
        assert not waiting.done()
        os.write(terminal, b"\n")
        await asyncio.wait_for(waiting, 60)

    asyncio.run(scenario())
