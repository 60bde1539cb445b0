"""Messages of the ur-rtde process: its refusals, its silence and its end; no controller is needed."""

import asyncio
import gc
import os
import signal

import pytest

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.arm.messages import Beat, Halt, Outcome, Snapshot
from station.devices.arm.process_handle import ArmProcess
from station.messages import arm as messages


def test_a_refusal_a_silence_and_an_end_are_messages():
    async def fault_of(process: ArmProcess, deadline_s: float) -> ArmFault:
        with pytest.raises(ArmFault) as caught:
            await process.request(Beat(healthy_for_s=0.0), Snapshot, deadline_s=deadline_s)
        return caught.value

    async def run():
        process = await ArmProcess.spawn("127.0.0.1", 125.0)
        try:
            assert (await fault_of(process, 30.0)).detail == messages.STATE_NOT_RECEIVED()
            braked = await process.request(Halt(deceleration_rad_s2=1.0), Outcome, deadline_s=30.0)
            assert (braked.done, braked.output) == (False, messages.NOT_COMMANDED())
            os.kill(process.pid, signal.SIGSTOP)
            silent = await fault_of(process, 0.2)
            assert silent.cause is ArmCause.DEADLINE
            assert silent.detail == messages.PROCESS_SILENT(limit_s=0.2, request=messages.REQUEST_BEAT())
            os.kill(process.pid, signal.SIGKILL)
            ended = await fault_of(process, 30.0)
            assert ended.cause is ArmCause.LINK_LOST
            assert ended.detail == messages.PROCESS_ENDED(code=-signal.SIGKILL)
        finally:
            await process.end()

    asyncio.run(run())


def test_requests_leave_nothing_behind():
    """They come many times a second, for months: what each one leaves adds up."""

    def futures() -> int:
        gc.collect()
        return sum(isinstance(each, asyncio.Future) for each in gc.get_objects())

    async def run():
        process = await ArmProcess.spawn("127.0.0.1", 125.0)
        try:
            await process.request(Halt(deceleration_rad_s2=1.0), Outcome, deadline_s=30.0)
            before = futures()
            for _ in range(100):
                await process.request(Halt(deceleration_rad_s2=1.0), Outcome, deadline_s=30.0)
            assert futures() < before + 10
        finally:
            await process.end()

    asyncio.run(run())
