"""Alarms page: active and shelved alarms, their procedures, acknowledgement, and the history."""

from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Form, Path, Query, Request
from starlette.responses import Response

from hmi.web.access import HmiNow, LocaleNow, caller_of, orders
from hmi.web.context import Hmi
from hmi.web.gateway import Gateway
from hmi.web.live import Part, of_state
from hmi.web.navigation import Entry
from hmi.web.page import go_to, show, show_part
from hmi.web.problem import Problem
from hmi.web.roles import Right
from hmi.web.sessions import Caller
from hmi.web.translation import Locale
from station.channel.line import CommandDone
from station.channel.messages import ChannelMessage, RefusedError
from station.channel.panel import AcknowledgeAlarm, ListedAlarm, ShelveAlarm, UnshelveAlarm

router = APIRouter()
ENTRY = Entry("alarms", "/alarms")
ACKNOWLEDGEABLE = frozenset({"unacknowledged", "returned", "latched_unacknowledged"})
SHELVES_S = (600, 3600, 4 * 3600, 8 * 3600)
REASONS = ("being_mended", "known", "nuisance")
_HISTORY_PAGE = 100
Operator = Annotated[Caller, Depends(orders(Right.HANDLE_ALARMS))]
AlarmName = Annotated[str, Path(pattern=r"^[a-z_]{1,40}$")]


def _alarms_values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
    alarms = () if gateway.state is None else gateway.state.alarms
    return {
        "heard": gateway.state is not None,
        "shown": [each for each in alarms if each.shelved_until_utc_ms is None],
        "shelved": [each for each in alarms if each.shelved_until_utc_ms is not None],
        "acknowledgeable": ACKNOWLEDGEABLE,
    }


PARTS = {"alarms.not_normal": Part("alarms_standing.html.j2", of_state(lambda state: state.alarms), _alarms_values)}


@router.get("/alarms")
async def alarms(request: Request) -> Response:
    """Show active and shelved alarms."""
    return show(request, "alarms.html.j2")


@router.get("/alarms/history")
async def history(
    request: Request, hmi: HmiNow, below: Annotated[int | None, Query(ge=1, le=2**53)] = None
) -> Response:
    """Show a page of the changes of alarms."""
    changes, older = await hmi.past.alarm_changes(_HISTORY_PAGE, below)
    return show(request, "alarms_history.html.j2", changes=changes, older=older)


@router.get("/alarms/{alarm}")
async def one(request: Request, hmi: HmiNow, alarm: AlarmName) -> Response:
    """Show one alarm: its meaning, its effect, the remedy."""
    values = _one(request, hmi, alarm)
    if values is None:
        return go_to("/alarms")
    return show(request, "alarm.html.j2", **values, shelves_s=SHELVES_S, reasons=REASONS)


@router.get("/alarms/{alarm}/part")
async def one_part(request: Request, hmi: HmiNow, locale: LocaleNow, alarm: AlarmName) -> Response:
    """Render the same as a part, for polling; the page reloads itself once the alarm is normal or shelved."""
    if not hmi.gateway.fresh:
        raise Problem(503, "problem.no_answer")  # the page greys the part that it cannot renew
    values = _one(request, hmi, alarm)
    if values is None:
        return Response(headers={"x-state": "normal"})
    return show_part(hmi, locale, "alarm_part.html.j2", values, {"x-state": values["shown"]})


@router.post("/alarms/{alarm}/acknowledge")
async def acknowledge(hmi: HmiNow, caller: Operator, alarm: AlarmName, since: Annotated[int, Form(ge=0)]) -> Response:
    """Acknowledge an alarm if it is still the one that became active at `since`; a later one has not been read yet."""
    present = _listed(hmi, alarm)
    if present is not None and present.since_utc_ms != since:
        raise Problem(409, "alarms.raised_again")
    await _done(hmi.gateway, AcknowledgeAlarm(alarm=alarm, who=caller.name, role=caller.role))
    return go_to("/alarms")


@router.post("/alarms/{alarm}/shelve")
async def shelve(
    hmi: HmiNow,
    caller: Operator,
    alarm: AlarmName,
    for_s: Annotated[int, Form(gt=0, le=SHELVES_S[-1])],
    reason: Annotated[str, Form(max_length=200)],
) -> Response:
    """Shelve an alarm for a time, with a reason."""
    reason = "it is being mended" if reason == "being_mended" else reason
    request = ShelveAlarm(alarm=alarm, who=caller.name, role=caller.role, reason=reason, for_s=for_s)
    await _done(hmi.gateway, request)
    return go_to("/alarms")


@router.post("/alarms/{alarm}/unshelve")
async def unshelve(hmi: HmiNow, caller: Operator, alarm: AlarmName) -> Response:
    """Unshelve an alarm."""
    await _done(hmi.gateway, UnshelveAlarm(alarm=alarm, who=caller.name, role=caller.role))
    return go_to("/alarms")


def _listed(hmi: Hmi, alarm: str) -> ListedAlarm | None:
    """Return an alarm; None if it is in its normal state, or the station has not answered yet."""
    present = hmi.gateway.state.alarms if hmi.gateway.state else ()
    return next((each for each in present if each.alarm == alarm), None)


def _one(request: Request, hmi: Hmi, alarm: str) -> dict[str, Any] | None:
    found = _listed(hmi, alarm)
    if found is None:
        return None
    return {
        "alarm": found,
        "shown": "shown" if found.shelved_until_utc_ms is None else "shelved",
        "acknowledgeable": ACKNOWLEDGEABLE,
        "place": place(alarm),
        "may": caller_of(request).may,
        "Right": Right,
    }


async def _done(gateway: Gateway, request: ChannelMessage) -> None:
    done = await gateway.request(request, CommandDone)
    if not done.done:
        raise RefusedError(done.why or "")


def place(alarm: str) -> str:
    """Return the part of the station that an alarm is about, for the drawing of the station."""
    places = {
        "arm": (
            "emergency_stop",
            "protective_stop",
            "safety_fault",
            "arm_link_lost",
            "arm_not_remote",
            "arm_not_ready",
        ),
        "gripper": ("fruit_held", "gripper_link_lost", "gripper_fault", "gripper_jam"),
        "sensor": (
            "camera_lost",
            "camera_stale",
            "camera_led_dead",
            "camera_dirty",
            "camera_saturated",
            "reference_bad",
            "reference_drifting",
            "calibration_old",
        ),
        "plc": ("plc_heartbeat_lost", "plc_interface_lost"),
        "gate": ("can_node_lost", "gate_not_fired"),
        "fruit": ("many_no_result", "reject_rate", "no_recipe", "recipe_broken"),
    }
    return next((where for where, alarms in places.items() if alarm in alarms), "computer")
