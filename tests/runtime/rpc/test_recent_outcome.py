"""The page Run shows the outcome that the PLC was given, whenever the station learns of it."""

import asyncio
from types import SimpleNamespace
from typing import Any

from station.channel.panel_run import FruitSummary
from station.runtime.rpc import recent_inspections
from station.runtime.rpc.operator import PanelServer
from station.runtime.rpc.plc import PlcInterfaceServer
from station.runtime.rpc.recent_inspections import RecentInspections

PASSED = FruitSummary(
    sequence=1, outcome="PASS", reasons=(), ended_utc_ms=1, duration_ms=1900, recipe="strawberry", lot="",
    area_mm2=60.0, closing_mm=3.0, areas_mm2=(),
)  # fmt: skip


def test_an_outcome_that_was_published_before_the_stations_own_is_delivered_is_shown(monkeypatch):
    monkeypatch.setattr(recent_inspections, "_new_fruit", lambda _, short: (SimpleNamespace(short=short), None))
    late = PASSED.model_copy(update={"outcome": "NO_RESULT", "reasons": ("late",)})
    published: Any = late
    recent = RecentInspections(lambda _lot, _below: {})
    recent.set_outcome(published)
    now: Any = SimpleNamespace(standing=PASSED, published=late)
    recent.add(now)
    assert recent.recent(1) == (late,)
    assert recent.counts("").unjudged == 1


def test_earlier_fruit_are_restored_before_the_plc_interface_can_publish_another_outcome_of_them(bench, monkeypatch):
    order, restore, make = list[str](), PanelServer.restore, PlcInterfaceServer.__init__

    async def restored(self):
        await restore(self)
        order.append("restored")

    def made(self, *arguments):
        order.append("made")
        make(self, *arguments)

    monkeypatch.setattr(PanelServer, "restore", restored)
    monkeypatch.setattr(PlcInterfaceServer, "__init__", made)

    async def scenario():
        async with bench():
            assert order == ["restored", "made"]

    asyncio.run(scenario())
