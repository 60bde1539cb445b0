"""Works done at the same time: all end, or the first error ends them all."""

import asyncio

import pytest

from station.messages.message import verbatim
from station.runtime.devices.rig import FramesError, at_once


def test_where_one_fails_the_others_are_cancelled_and_its_own_error_is_raised():
    ended = []

    async def waits():
        try:
            await asyncio.Event().wait()
        except asyncio.CancelledError:
            ended.append("cancelled")
            raise

    async def fails():
        await asyncio.sleep(0)
        raise FramesError(verbatim("no good frame"), ())

    with pytest.raises(FramesError, match="no good frame"):
        asyncio.run(at_once(waits(), fails(), waits()))
    assert ended == ["cancelled"] * 2


def test_it_ends_when_all_have_ended_and_a_cancelled_one_cancels_them():
    ended = []

    async def works(name):
        await asyncio.sleep(0)
        ended.append(name)

    asyncio.run(at_once(works("a"), works("b")))
    assert sorted(ended) == ["a", "b"]

    async def called_off():
        task = asyncio.create_task(at_once(asyncio.Event().wait(), works("c")))
        await asyncio.sleep(0.01)
        task.cancel()
        await task

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(called_off())
