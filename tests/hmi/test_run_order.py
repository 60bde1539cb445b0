"""The order that the run page shows: one in progress, and for a minute one that failed, with who gave it."""

import re

import pytest

from hmi.web.translation import Locale
from station.channel.panel_live import Counts, OperatorCommandName, OperatorCommandView, PanelState
from station.messages import commands
from station.messages.message import verbatim

BEGAN_MS, ENDED_MS = 1_790_000_000_000, 1_790_000_001_000


def state(order_state, utc_ms):
    failed = order_state == "failed"
    order = OperatorCommandView(
        ticket=1, order=OperatorCommandName.START, argument="", state=order_state, who="Ana", began_utc_ms=BEGAN_MS,
        why=commands.ENDING() if failed else None, ended_utc_ms=None if order_state == "executing" else ENDED_MS,
    )  # fmt: skip
    return PanelState.model_construct(  # pyrefly: ignore[missing-argument] (what the page reads)
        boot="1", utc_ms=utc_ms, state="idle", activity=verbatim(""), packml_state=None, mode=1, ready=True,
        why_not_ready=None, busy=False, needs_person=False, stopping=False, simulated=False, recipe=None, lot=None,
        named_lot="", plc_names_lots=False, alarms=(), devices=(), orders=(order,), may=(), recoveries=(),
        running_sequence=None, last_sequence=None, lot_counts=Counts(),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("order_state", "after_ms", "words"),
    [
        ("executing", 3_600_000, "Start: in progress."),
        ("failed", 60_000, "Start: not done. the station is ending"),
        ("failed", 60_001, ""),
        ("done", 0, ""),
    ],
)
def test_an_order_is_shown_in_progress_and_a_minute_after_it_failed(pages, order_state, after_ms, words):
    pages.context.gateway.state = state(order_state, ENDED_MS)
    pages("GET", "/")  # what is shown has to follow the time alone
    pages.context.gateway.state = state(order_state, ENDED_MS + after_ms)
    lines = re.findall('class="order-line" role="status">(.*?)</p>', pages("GET", "/")[2].decode())
    by = f" <small>Ana, {Locale('en').clock(BEGAN_MS)}</small>"
    assert [line.lower() for line in lines] == ([f"{words}{by}".lower()] if words else [])
