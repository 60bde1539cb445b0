"""The pages' gateway: what is polled of the station, and when the last fruit is requested again."""

import asyncio
from typing import Any

from hmi.web.gateway import Gateway
from hmi.web.roles import Role
from hmi.web.translation import Locale
from station.channel.line import Outcome
from station.channel.panel_run import (
    Fruit,
    FruitSummary,
    GetFruit,
    GetPanelState,
    GetRecent,
    OperatorCommandName,
    PanelState,
    Recent,
)
from station.runtime.rpc.recent_inspections import RecentFruit, RecentInspections
from station.vocabulary import Reason

PASSED = FruitSummary(
    sequence=7, outcome="PASS", reasons=(), ended_utc_ms=1, duration_ms=1900, recipe="strawberry", lot="A",
    area_mm2=60.0, closing_mm=3.0, areas_mm2=(),
)  # fmt: skip


class Station(Gateway):
    """A gateway whose requests a station's recent fruit answer."""

    def __init__(self, inspections: RecentInspections) -> None:
        super().__init__("ipc:///nowhere", 0.01)
        self._inspections, self.requested = inspections, list[str]()

    async def request(self, request: Any, reply: Any, *, deadline_s: float = 2.0) -> Any:
        self.requested.append(type(request).__name__)
        match request:
            case GetPanelState():
                last = self._inspections.last_sequence
                values: dict[str, Any] = {
                    "boot": "1",
                    "last_sequence": last,
                    "fruit_changes": self._inspections.changes,
                }
                return PanelState.model_construct(**values)
            case GetRecent():
                return Recent(fruit=self._inspections.recent(request.most))
            case GetFruit():
                return self._inspections.fruit(request.sequence)
        raise AssertionError(request)


def test_the_button_that_aborts_a_fruit_is_the_running_ones(pages):
    """Also where nothing else of the buttons has changed since the fruit before."""
    for sequence in (None, 7, 8):
        may = (OperatorCommandName.STOP, OperatorCommandName.CALL_OFF)
        values: dict[str, Any] = {"may": may, "recoveries": (), "needs_person": False, "running_sequence": sequence}
        pages.context.gateway.state = PanelState.model_construct(**values)
        buttons = pages.context.live.part("run.buttons", Locale("en"), Role.OPERATOR).html
        assert f'name="argument" value="{sequence or ""}"' in buttons


def test_an_outcome_that_the_plc_was_given_in_place_of_the_stations_is_shown():
    async def scenario():
        inspections, full = RecentInspections(lambda *_: {}), dict[str, Any](short=PASSED)
        inspections.restore([PASSED], [RecentFruit(Fruit.model_construct(**full), None)], {"A": {"PASS": 1}})
        async with Station(inspections) as gateway:
            await gateway.polled()
            await gateway.polled()
            shown = [gateway.last.short.outcome if gateway.last else None]
            published: dict[str, Any] = {"sequence": 7, "outcome": "NO_RESULT", "reasons": (Reason.LATE,)}
            inspections.set_outcome(Outcome.model_construct(**published))
            await gateway.polled()
            await gateway.polled()
            shown.append(gateway.last.short.outcome if gateway.last else None)
            return shown, gateway.recent.fruit[0].outcome, gateway.requested.count("GetFruit")

    assert asyncio.run(scenario()) == (["PASS", "NO_RESULT"], "NO_RESULT", 2)
