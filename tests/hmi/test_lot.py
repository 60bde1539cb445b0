"""A lot that is ended at a page: the one that the page shows, and no later one."""

import re
from types import SimpleNamespace
from typing import Any

import pytest

from hmi.web.roles import Role
from station.channel.panel_run import OperatorCommandView, PanelState
from station.messages import lots
from station.messages.operation import INTERNAL_FAULT
from station.runtime.production.lots import LotManager
from station.runtime.production.operator_commands import OperatorCommands
from tests.hmi.test_security import log_in


@pytest.fixture
def station(pages, monkeypatch) -> OperatorCommands:
    """The station's commands behind the pages; an operator is logged in."""
    nothing: Any = SimpleNamespace(
        stopped_by_person=False, log_command=lambda *_: None, active=None, write=lambda *_: True
    )
    manager = LotManager(nothing, nothing, nothing, nothing)
    commands = OperatorCommands(nothing, nothing, nothing, manager, nothing, nothing)

    async def request(order, _reply, **_):
        entry = await commands.start(order)
        pages.context.gateway.state = PanelState.model_construct(  # pyrefly: ignore[missing-argument]
            utc_ms=1, alarms=(), plc_names_lots=False, named_lot=manager.named, state="idle", ready=True, busy=False,
            why_not_ready=None, packml_state=None, recipe=None, simulated=False, lot=None,
        )  # fmt: skip
        return entry

    monkeypatch.setattr(pages.context.gateway, "request", request)
    log_in(pages, "Ana", Role.OPERATOR)
    return commands


def test_a_page_that_shows_another_lot_ends_none(pages, station):
    async def ended(_change):
        """The lot of the records."""

    station._records = SimpleNamespace(change_to_end=ended)

    def start(lot: str) -> None:
        assert pages.post("/order", csrf=pages.token(), order="start_lot", argument=lot)[0] == 303

    def end() -> OperatorCommandView:
        """Send the form of the page that was opened last."""
        form = next(each for each in re.findall("<form.*?</form>", page, re.DOTALL) if 'value="end_lot"' in each)
        assert pages.post("/order", **dict(re.findall('name="([^"]+)" value="([^"]*)"', form)))[0] == 303
        return station.recent[0]

    start("A-17")
    page = pages("GET", "/lot")[2].decode()
    start("B-18")
    late = end()
    assert (late.state, late.why) == ("failed", lots.ANOTHER(lot="A-17", now="B-18"))
    assert station._lots.named == "B-18", "its fruit go on having a lot"
    page = pages("GET", "/lot")[2].decode()
    assert end().state == "done"
    assert station._lots.named == ""


def test_a_command_that_ends_by_a_bug_has_failed_and_says_so(pages, station, monkeypatch):
    async def fails(*_lot):
        raise RuntimeError("a bug")

    monkeypatch.setattr(station, "_start_lot", fails)
    assert pages.post("/order", csrf=pages.token(), order="start_lot", argument="A-17")[0] == 303
    [entry] = station.recent
    assert (entry.state, entry.why) == ("failed", INTERNAL_FAULT(words="RuntimeError: a bug"))
