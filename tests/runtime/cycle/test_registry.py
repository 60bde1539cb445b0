"""Each durable trigger gets its one outcome, also where a stop comes in the moment in which it became durable."""

import asyncio

from station.inspection.cycle import Event
from station.inspection.states import State
from station.vocabulary import Reason


def test_a_trigger_is_not_refused_by_a_stop_that_comes_right_after_it_became_durable(bench, monkeypatch):
    async def scenario():
        async with bench() as cell:
            await cell.choose("blueberry")
            service = cell.station.service
            begin = service.registry.records.begin

            async def stopped_at_the_end(trigger):
                sequence = await begin(trigger)
                service.runner.post(Event.STOP)  # taken in the next turn of the loop
                return sequence

            monkeypatch.setattr(service.registry.records, "begin", stopped_at_the_end)
            at_stop = []
            cell.at(State.STOPPED, lambda: at_stop.append(service._now))
            reply = await cell.line.begin()
            assert reply.refusal is None
            outcome = await cell.line.outcome(reply.sequence)
            assert (outcome.outcome, outcome.reasons[0]) == ("NO_RESULT", Reason.CALLED_OFF)
            assert at_stop == [None], "it was stopped before its inspection began"

    asyncio.run(scenario())
