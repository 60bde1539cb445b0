"""One fruit, from the trigger to the outcome that the PLC gets, on a simulated bench."""

import asyncio

import pytest


@pytest.mark.parametrize("kind", ["strawberry", "raspberry", "blueberry"])
def test_a_fruit_gets_one_outcome_with_its_area_near_the_truth(bench, kind):
    async def scenario():
        async with bench() as cell:
            await cell.choose(kind)
            outcome = await cell.line.inspect()
            record = await cell.station.service.records.inspection(outcome.sequence)
            return outcome, record

    outcome, record = asyncio.run(scenario())
    print(outcome, record.judged.explanation)
    assert outcome.outcome in {"PASS", "FAIL"}
