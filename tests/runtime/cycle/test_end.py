"""The end of the station's process while a fruit is inspected."""

import asyncio
import contextlib
import logging

import pytest

from station.inspection.cycle import Action
from station.inspection.states import State
from station.vocabulary import Reason
from tests.eventually import PATIENCE_S


@pytest.mark.timeout(240)
def test_an_end_whose_clean_up_takes_longer_than_its_deadline_keeps_the_fruits_one_outcome(
    bench, settings_file, caplog
):
    file = settings_file(clean_up_deadline_s=1.0)

    async def scenario():
        async def held(*_):
            await asyncio.Event().wait()

        async with bench(file) as cell:
            await cell.choose("blueberry")
            await cell.line.ready()
            reply = await cell.line.begin()
            await cell.reach(State.CLOSING_TO_ONSET)
            service = cell.station.service
            service._of_station = {**service._of_station, Action.OPEN_JAWS: held, Action.GO_HOME: held}
            service._of_inspection = {**service._of_inspection, Action.FREE_FRUIT: held}
            cell.station.stop()
            async with asyncio.timeout(PATIENCE_S):
                await asyncio.shield(cell.running)
        async with bench(file) as cell:
            return reply, (await cell.line.open()).outcomes

    with caplog.at_level(logging.WARNING, "station.runtime.station"):
        reply, outcomes = asyncio.run(scenario())
    assert "ended after 1 s in the middle of" in caplog.text
    assert [(each.sequence, each.outcome) for each in outcomes] == [(reply.sequence, "NO_RESULT")]
    assert outcomes[0].reasons == (Reason.STATION_LOST,), "it was not stored in time: the next start does that"


@pytest.mark.timeout(240)
def test_an_end_does_not_wait_beyond_its_deadline_for_what_is_moved_by_hand(bench, settings_file, caplog):
    file, released = settings_file(clean_up_deadline_s=1.0), asyncio.Event()

    async def stubborn():
        while not released.is_set():
            with contextlib.suppress(asyncio.CancelledError):
                await released.wait()

    async def scenario():
        async with bench(file) as cell:
            cell.station.service.end_manual = stubborn
            cell.station.stop()
            async with asyncio.timeout(PATIENCE_S):
                await asyncio.shield(cell.running)
            released.set()

    with caplog.at_level(logging.WARNING, "station.runtime.station"):
        asyncio.run(scenario())
    assert "ended after 1 s in the middle of" in caplog.text
