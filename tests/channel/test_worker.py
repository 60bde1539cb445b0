"""Worker thread of page requests: one holder's slow requests, and another's."""

import asyncio
import threading

import pytest

from station.channel.worker import MOST_WAITING, PanelBusyError, PanelWorker

PATIENCE_S = 60.0


def test_slow_requests_of_one_holder_keep_no_other_waiting():
    async def scenario():
        worker, steps = PanelWorker(), threading.Semaphore(0)
        try:
            slow = [
                asyncio.create_task(worker.do(lambda: steps.acquire(timeout=PATIENCE_S), "10.0.0.7"))
                for _ in range(MOST_WAITING)
            ]
            await asyncio.sleep(0)
            with pytest.raises(PanelBusyError):
                await worker.do(lambda: None, "10.0.0.7")
            other = asyncio.create_task(worker.do(lambda: "served", "person Ana"))
            await asyncio.sleep(0)
            steps.release()  # the one under way ends
            assert await asyncio.wait_for(other, PATIENCE_S) == "served"
            assert sum(each.done() for each in slow) == 1
            steps.release(MOST_WAITING)
            assert await asyncio.gather(*slow) == [True] * MOST_WAITING
        finally:
            steps.release(MOST_WAITING)
            worker.close()

    asyncio.run(scenario())


def test_what_is_no_longer_waited_for_gives_the_turn_on(monkeypatch):
    async def scenario():
        worker, steps = PanelWorker(), threading.Semaphore(0)
        try:
            monkeypatch.setattr("station.channel.worker.LONGEST_S", 0.05)
            with pytest.raises(PanelBusyError):
                await worker.do(lambda: steps.acquire(timeout=PATIENCE_S), "10.0.0.7")
            monkeypatch.setattr("station.channel.worker.LONGEST_S", PATIENCE_S)
            steps.release()
            assert await worker.do(lambda: "served", "10.0.0.7") == "served"
        finally:
            steps.release()
            worker.close()

    asyncio.run(scenario())
