"""The order that the run page shows, whichever page gave it: one in progress, and for a minute one that failed.

Likewise the change of the mode on the page that gives it.
"""

import re

import pytest

from hmi.maintenance import routes as maintenance
from hmi.web.roles import Role
from hmi.web.translation import Locale
from station.channel.panel_maintenance import Health
from station.channel.panel_run import Counts, OperatorCommand, OperatorCommandName, OperatorCommandView, PanelState
from station.messages import commands
from station.messages.message import verbatim

BEGAN_MS, ENDED_MS = 1_790_000_000_000, 1_790_000_001_000


def command(order_state, order=OperatorCommandName.START, ticket=1):
    failed = order_state == "failed"
    return OperatorCommandView(
        ticket=ticket, order=order, argument="", state=order_state, who="Ana", began_utc_ms=BEGAN_MS,
        why=commands.ENDING() if failed else None, ended_utc_ms=None if order_state == "executing" else ENDED_MS,
    )  # fmt: skip


def state(utc_ms, *orders):
    return PanelState.model_construct(  # pyrefly: ignore[missing-argument] (what the page reads)
        boot="1", utc_ms=utc_ms, state="idle", activity=verbatim(""), packml_state=None, mode=1, ready=True,
        why_not_ready=None, busy=False, needs_person=False, stopping=False, simulated=False, recipe=None, lot=None,
        named_lot="", plc_names_lots=False, alarms=(), devices=(), orders=orders, may=(), recoveries=(),
        running_sequence=None, last_sequence=None, lot_counts=Counts(),
    )  # fmt: skip


def shown(pages):
    lines = re.findall('class="order-line" role="status">(.*?)</p>', pages("GET", "/")[2].decode())
    return [line.lower() for line in lines]


def line(order, words):
    return f"{Locale('en').text(f'order.{order}')}: {words} <small>Ana, {Locale('en').clock(BEGAN_MS)}</small>".lower()


@pytest.mark.parametrize("order", OperatorCommandName)
@pytest.mark.parametrize(
    ("order_state", "after_ms", "words"),
    [
        ("executing", 3_600_000, "in progress."),
        ("failed", 60_000, "not done. the station is ending"),
        ("failed", 60_001, ""),
        ("done", 0, ""),
    ],
)
def test_an_order_is_shown_in_progress_and_a_minute_after_it_failed(pages, order, order_state, after_ms, words):
    given = command(order_state, order)
    pages.context.gateway.state = state(ENDED_MS, given)
    pages("GET", "/")  # what is shown has to follow the time alone
    pages.context.gateway.state = state(ENDED_MS + after_ms, given)
    assert shown(pages) == ([line(order, words)] if words else [])


def test_a_change_of_fruit_in_progress_is_shown_until_its_end_though_a_later_order_is_done(pages):
    later, change = command("done", ticket=2), command("executing", OperatorCommandName.CHOOSE_RECIPE)
    pages.context.gateway.state = state(ENDED_MS, later, change)
    assert shown(pages) == [line("choose_recipe", "in progress.")]
    failed = command("failed", ticket=2)
    pages.context.gateway.state = state(ENDED_MS, failed, change)
    assert shown(pages) == [line("start", "not done. the station is ending")]


@pytest.mark.parametrize("tab", ["hand", "sensor"])
@pytest.mark.parametrize("end", [None, "done", "failed"])
def test_a_change_of_mode_says_what_became_of_it(pages, monkeypatch, end, tab):
    given = command("executing", OperatorCommandName.SET_MODE)

    async def answer(request, *_, **__):
        if isinstance(request, OperatorCommand):
            pages.context.gateway.state = state(ENDED_MS, command(end or "executing", OperatorCommandName.SET_MODE))
            return given
        return Health.model_construct(mode=1, jog_refused=None, width_mm=40.0)  # pyrefly: ignore[missing-argument]

    monkeypatch.setattr(pages.context.gateway, "request", answer)
    monkeypatch.setattr(maintenance, "MODE_S", 0.3)
    pages.cookies["station_session_8080"] = pages.context.sessions.log_in("Max", Role.MAINTENANCE)
    status, headers, body = pages.post("/maintenance/mode", csrf=pages.token(), mode="3", tab=tab)
    if end == "failed":
        assert status == 409
        assert "the station is ending" in body.decode().lower()
    else:
        assert (status, headers["location"]) == (303, f"/maintenance/{tab}")
    page = pages("GET", "/maintenance/hand")[2].decode()
    assert "Set manual mode" in page
    assert ("Change the mode: in progress." in page) == (end is None)
    assert ("Change the mode: not done. " in page) == (end == "failed")
