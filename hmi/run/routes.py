"""Run page: the station's activity, the operator's next action, and the latest fruit."""

import base64
from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from statistics import median
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Form, Path, Request
from starlette.responses import Response

from hmi.common.charts import deciding_limit
from hmi.common.commands import shown_command
from hmi.run import charts
from hmi.web.access import HmiNow, LocaleNow, orders
from hmi.web.gateway import ORDER_DEADLINE_S, Gateway, actor_of
from hmi.web.live import Part, of_state
from hmi.web.navigation import Entry
from hmi.web.page import go_to, show
from hmi.web.problem import Problem
from hmi.web.roles import Right
from hmi.web.sessions import Caller
from hmi.web.translation import Locale
from station.channel.messages import RefusedError
from station.channel.panel_run import (
    Fruit,
    FruitSummary,
    GetFruit,
    GetPicture,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
    Picture,
)
from station.charts.spark import spark
from station.vocabulary import LONGEST_GROWER

router = APIRouter()
ENTRY = Entry("run", "/")
MOST_RECENT = 10
_TAKT_OF = 20
"""So many fruit's intervals, of which the median is no pause of the line."""
_MOST_REASONS = 3
_LEAST_INTERVALS = 3
_ORDERS = frozenset(
    {
        OperatorCommandName.START,
        OperatorCommandName.STOP,
        OperatorCommandName.CALL_OFF,
        OperatorCommandName.RECOVER,
        OperatorCommandName.START_LOT,
        OperatorCommandName.END_LOT,
    }
)
"""Given on this page; all that are given on any page are shown."""
_IMMUTABLE = "private, max-age=31536000, immutable"
Sequence = Annotated[int, Path(ge=1, lt=2**32)]


def _shown_order(state: PanelState) -> OperatorCommandView | None:
    return shown_command(state.orders, state.utc_ms)


def _activity_values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
    state = gateway.state
    return {"state": state, "order": None if state is None else _shown_order(state)}


def _fruit(gateway: Gateway) -> object:
    return gateway.last, _never_inspected(gateway)


def _fruit_values(gateway: Gateway, locale: Locale) -> Mapping[str, Any]:
    return {**fruit_values(gateway.last, locale), "on_run": True, "never_inspected": _never_inspected(gateway)}


def _never_inspected(gateway: Gateway) -> bool:
    """Return whether the station's records have no fruit: its set-up is not finished."""
    return gateway.state is not None and gateway.state.last_sequence is None


def _figures(gateway: Gateway) -> object:
    state = gateway.state
    if state is None:
        return None
    return gateway.last, state.recipe, state.lot, state.named_lot, state.lot_counts, state.plc_names_lots


def _figures_values(gateway: Gateway, locale: Locale) -> Mapping[str, Any]:
    fruit = gateway.recent.fruit
    reasons = Counter(reason for each in fruit for reason in each.reasons[:1])
    return {
        "state": gateway.state,
        "last": gateway.last,
        "looked_at": len(fruit),
        "diverted": sum(each.outcome != "PASS" for each in fruit) / len(fruit) if fruit else None,
        "reasons": reasons.most_common(_MOST_REASONS),
        "trend": charts.trend(fruit, locale),
        "bar": charts.bar,
        "takt_s": _takt_s(fruit[:_TAKT_OF]),
    }


def _takt_s(fruit: tuple[FruitSummary, ...]) -> float | None:
    """Return the line's takt: the usual time between two fruit; None for too few fruit."""
    between_ms = [later.ended_utc_ms - earlier.ended_utc_ms for later, earlier in pairwise(fruit)]
    return median(between_ms) / 1000 if len(between_ms) >= _LEAST_INTERVALS else None


def _recent_values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
    return {"fruit": gateway.recent.fruit[:MOST_RECENT], "spark": spark}


PARTS = {
    "run.activity": Part(
        "run_activity.html.j2",
        of_state(lambda state: (state.model_copy(update={"utc_ms": 0, "devices": ()}), _shown_order(state))),
        _activity_values,
    ),
    "run.buttons": Part(
        "run_buttons.html.j2",
        of_state(lambda state: (state.may, state.recoveries, state.needs_person, state.running_sequence)),
        lambda gateway, _: {"state": gateway.state, "OperatorCommandName": OperatorCommandName},
    ),
    "run.fruit": Part("run_fruit.html.j2", _fruit, _fruit_values),
    "run.figures": Part("run_figures.html.j2", _figures, _figures_values),
    "run.recent": Part("run_recent.html.j2", lambda gateway: gateway.recent, _recent_values),
}


def fruit_values(fruit: Fruit | None, locale: Locale) -> Mapping[str, Any]:
    """Return the values that `run_fruit.html.j2` needs for a fruit."""
    if fruit is None:
        return {"fruit": None}
    limit = deciding_limit(fruit.limits, fruit.short.closing_mm)
    return {"fruit": fruit, "limit": limit, "curve": charts.curve(fruit, locale)}


@router.get("/")
async def run(request: Request) -> Response:
    """Show the page."""
    return show(request, "run.html.j2", most_recent=MOST_RECENT)


@router.get("/fruit/{sequence}")
async def fruit(request: Request, hmi: HmiNow, locale: LocaleNow, sequence: Sequence) -> Response:
    """Show one of the latest fruit; an older one is in the history."""
    try:
        found = await hmi.gateway.request(GetFruit(sequence=sequence), Fruit)
    except RefusedError:
        return go_to(f"/history/{sequence}")
    return show(request, "fruit.html.j2", **fruit_values(found, locale), on_run=False)


@router.get("/fruit/{sequence}/picture.svg")
async def picture(hmi: HmiNow, sequence: Sequence) -> Response:
    """Send a fruit's picture with the contact's outline; a browser fetches it once.

    Its address on a page ends with the fruit's end, which is not read here: a number comes again after the records
    are removed.
    """
    found = await hmi.gateway.request(GetPicture(sequence=sequence), Picture)
    # The text is inserted into the SVG: anything but base64 is refused here.
    base64.b64decode(found.jpeg, validate=True)
    corners = " ".join(f"{x},{y}" for x, y in found.outline)
    size = f'width="{found.width_px}" height="{found.height_px}"'
    # A light line upon a dark one is seen on any picture.
    outline = "".join(
        f'<polygon points="{corners}" fill="none" stroke="{colour}" stroke-width="{width_px}" stroke-linejoin="round"/>'
        for colour, width_px in (("#000", 7), ("#fff", 3))
        if corners
    )
    drawn = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {found.width_px} {found.height_px}" {size}>'
        f'<image {size} href="data:image/jpeg;base64,{found.jpeg}"/>{outline}</svg>'
    )
    return Response(drawn, media_type="image/svg+xml", headers={"cache-control": _IMMUTABLE})


@router.post("/order")
async def order(
    hmi: HmiNow,
    caller: Annotated[Caller, Depends(orders(Right.RUN))],
    order: Annotated[OperatorCommandName, Form()],
    argument: Annotated[str, Form(max_length=64)] = "",
    grower: Annotated[str, Form(max_length=LONGEST_GROWER)] = "",
) -> Response:
    """Start, stop, cancel, recover, or begin and end a lot; the page shows the result."""
    if order not in _ORDERS:
        raise Problem(400, "problem.bad_form")
    request = OperatorCommand(person=actor_of(caller), order=order, argument=argument, grower=grower)
    await hmi.gateway.request(request, OperatorCommandView, deadline_s=ORDER_DEADLINE_S)
    return go_to("/")


@router.get("/lot")
async def lot(request: Request) -> Response:
    """Show the form that begins and ends a lot, if the PLC names none."""
    return show(request, "lot.html.j2")
