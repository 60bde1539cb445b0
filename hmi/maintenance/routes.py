"""Maintenance page: health, support bundle, manual control, live image, calibration, PLC registers, log."""

import asyncio
import re
import time
from collections import OrderedDict
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from fastapi import APIRouter, Depends, Form, Query, Request
from pydantic import StringConstraints
from starlette.responses import FileResponse, Response

from hmi.common.commands import shown_command
from hmi.maintenance.histogram import histogram
from hmi.web.access import HmiNow, LocaleNow, may, orders
from hmi.web.context import Hmi
from hmi.web.gateway import SLOW_DEADLINE_S, STALE_S, Gateway, actor_of
from hmi.web.live import Part, of_state
from hmi.web.navigation import Entry
from hmi.web.page import go_to, show, show_part
from hmi.web.problem import Problem
from hmi.web.roles import Right
from hmi.web.sessions import Caller
from hmi.web.translation import Locale
from station.channel.messages import ChannelError, RefusedError
from station.channel.panel_maintenance import (
    CalibrationRunView,
    CalibrationState,
    ContinueCalibrationRun,
    EndCalibrationRun,
    GetCalibration,
    GetHealth,
    GetLiveImage,
    GetRegisters,
    Health,
    ImageFile,
    Jogged,
    JogGripper,
    LedsSet,
    LiveImage,
    Log,
    NoteGelChange,
    ReadLog,
    Registers,
    SetLeds,
    StartCalibrationRun,
)
from station.channel.panel_run import (
    GetRecipes,
    OperatorCommand,
    OperatorCommandName,
    OperatorCommandView,
    PanelState,
    PersonNoted,
    Recipes,
)

router = APIRouter(prefix="/maintenance")
ENTRY = Entry("maintenance", "/maintenance")
MOVE_DEADLINE_S = 30.0
"""For a request that waits for a movement. An estimate."""
MODE_S = 5.0
"""How long the page waits for the end of a change of the mode. An estimate."""
JOG_STEP_MM = 1.0
LOG_LINES = 50
_IMAGE_DEADLINE_S = 5.0
"""For a live image with its contact. An estimate."""
_FRAMES: OrderedDict[str, ImageFile] = OrderedDict()
"""The last live images: a page gets the address of one, and then fetches it."""
_KEPT_FRAMES = 8
_PLACE = re.compile(r"^\s*(-?\d+(?:[.,]\d+)?)\s*[; ]\s*(-?\d+(?:[.,]\d+)?)\s*$")

Maintainer = Annotated[Caller, Depends(orders(Right.MAINTAIN))]
Level = Literal["DEBUG", "INFO", "WARNING", "ERROR"]
Brightness = Annotated[int, Form(ge=0, le=15)]
ModeTab = Literal["hand", "sensor"]
"""Tabs with the mode's button."""


def _mode_command(state: PanelState) -> OperatorCommandView | None:
    given = [each for each in state.orders if each.order is OperatorCommandName.SET_MODE]
    return shown_command(given, state.utc_ms)


def _mode_part(tab: str) -> Part:
    """Make the mode's button and what became of it, for a tab to which the button comes back."""

    def values(gateway: Gateway, _: Locale) -> Mapping[str, Any]:
        state = gateway.state
        return {"tab": tab, "state": state, "command": None if state is None else _mode_command(state)}

    return Part("maintenance_mode.html.j2", of_state(lambda state: (state.mode, _mode_command(state))), values)


PARTS = {f"maintenance.mode_{tab}": _mode_part(tab) for tab in get_args(ModeTab)}


@router.get("")
async def health(request: Request, hmi: HmiNow) -> Response:
    """Show the health of every part."""
    return show(request, "maintenance.html.j2", tab="health", **await _health(hmi))


@router.get("/health/part")
async def health_part(hmi: HmiNow, locale: LocaleNow) -> Response:
    """Render the same as a part, for polling."""
    return show_part(hmi, locale, "maintenance_health.html.j2", await _health(hmi))


@router.get("/support.zip")
async def support(hmi: HmiNow, caller: Annotated[Caller, Depends(may(Right.MAINTAIN))]) -> Response:
    """Send a support bundle for download."""
    data = await hmi.past.support_bundle()
    await hmi.gateway.note(PersonNoted(person=actor_of(caller), what="support_bundle"))
    name = f"support-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.zip"
    headers = {"content-disposition": f'attachment; filename="{name}"'}
    return Response(data, media_type="application/zip", headers=headers)


@router.get("/hand")
async def hand(
    request: Request,
    hmi: HmiNow,
    locale: LocaleNow,
    at_mm: Annotated[float | None, Query(ge=-100, le=100, allow_inf_nan=False)] = None,
    lit: Annotated[Literal["yes"] | None, Query()] = None,
) -> Response:
    """Show the manual control of fingers and light; what cannot work now is disabled, and the page says why."""
    done = locale.text("maintenance.lit") if lit else ""
    if at_mm is not None:
        done = locale.text("maintenance.jogged", width=locale.number(at_mm, 1))
    values = await _health(hmi)
    return show(request, "maintenance_hand.html.j2", tab="hand", **values, allowed=_allowed(values), done=done)


@router.get("/hand/part")
async def hand_part(hmi: HmiNow, locale: LocaleNow) -> Response:
    """Render the fingers' width, for polling; the page reloads itself when moving becomes allowed or refused."""
    values = await _health(hmi)
    return show_part(hmi, locale, "maintenance_width.html.j2", values, {"x-state": _allowed(values)})


@router.post("/mode")
async def mode(
    hmi: HmiNow,
    caller: Maintainer,
    mode: Annotated[Literal["1", "3"], Form()],
    tab: Annotated[ModeTab, Form()] = "hand",
) -> Response:
    """Set manual mode, in which no fruit is accepted, or production again."""
    query = OperatorCommand(person=actor_of(caller), order=OperatorCommandName.SET_MODE, argument=mode)
    command = await hmi.gateway.request(query, OperatorCommandView, deadline_s=SLOW_DEADLINE_S)
    ended, until_s = None, time.monotonic() + MODE_S
    while ended is None and command.state != "failed" and time.monotonic() < until_s:
        await asyncio.sleep(0.1)
        ended = _ended(hmi, command.ticket)
    command = ended or command
    if command.state == "failed":
        raise RefusedError(command.why or "")
    return go_to(f"/maintenance/{tab}")


@router.post("/jog")
async def jog(
    hmi: HmiNow,
    caller: Maintainer,
    to: Annotated[Literal["open", "width", "stop", "wider", "narrower"], Form()],
    width_mm: Annotated[str, Form(max_length=12)] = "",
) -> Response:
    """Move the fingers, or stop them; the page shows their position, or why they do not move."""
    try:
        match to:
            case "width":
                query = JogGripper(to=to, width_mm=_mm(width_mm), actor=actor_of(caller))
            case "wider" | "narrower":
                width = await _stepped(hmi, JOG_STEP_MM if to == "wider" else -JOG_STEP_MM)
                query = JogGripper(to="width", width_mm=width, actor=actor_of(caller))
            case _:
                query = JogGripper(to=to, actor=actor_of(caller))
    except ValueError:
        raise Problem(400, "problem.bad_form") from None
    jogged = await hmi.gateway.request(query, Jogged, deadline_s=MOVE_DEADLINE_S)
    return go_to(f"/maintenance/hand?at_mm={jogged.width_mm:.1f}")


@router.post("/leds")
async def leds(hmi: HmiNow, caller: Maintainer, red: Brightness, green: Brightness, blue: Brightness) -> Response:
    """Set the sensor's light."""
    query = SetLeds(red=red, green=green, blue=blue, actor=actor_of(caller))
    await hmi.gateway.request(query, LedsSet, deadline_s=SLOW_DEADLINE_S)
    return go_to("/maintenance/hand?lit=yes")


@router.get("/image")
async def image(request: Request, hmi: HmiNow, contact: bool = True) -> Response:  # noqa: FBT001, FBT002
    """Show the live image, as fast as the browser takes it."""
    return show(request, "maintenance_image.html.j2", tab="image", contact=contact, **await _live(hmi, contact=contact))


@router.get("/image/part")
async def image_part(hmi: HmiNow, locale: LocaleNow, contact: bool = True) -> Response:  # noqa: FBT001, FBT002
    """Render the next image with its contact; requested after the one before was taken."""
    return show_part(hmi, locale, "maintenance_live.html.j2", await _live(hmi, contact=contact))


@router.get("/image/{place}.jpg")
async def frame(place: Annotated[str, StringConstraints(pattern=r"^\d{1,20}$")]) -> Response:
    """Send an image that `image_part` has named."""
    if place not in _FRAMES:
        raise Problem(404, "problem.not_found")
    return Response(_FRAMES[place].data, media_type=_FRAMES[place].media_type)


@router.get("/sensor")
async def sensor(
    request: Request,
    hmi: HmiNow,
    locale: LocaleNow,
    gel_changed: Annotated[Literal["yes"] | None, Query()] = None,
) -> Response:
    """Show calibration and verification, guided."""
    done = locale.text("maintenance.gel_noted") if gel_changed else ""
    return show(request, "maintenance_sensor.html.j2", tab="sensor", done=done, **await _calibration(hmi))


@router.get("/sensor/part")
async def sensor_part(hmi: HmiNow, locale: LocaleNow) -> Response:
    """Render the state of the calibration run."""
    reply = await _calibration(hmi)
    run = reply["now"].run
    over = run is None or run.state not in {"running", "waiting"}
    state = "" if run is None else run.state
    return show_part(hmi, locale, "maintenance_run.html.j2", reply, {"x-over": "1" if over else "", "x-state": state})


@router.get("/sensor/{kind}/{name}")
async def sensor_picture(
    hmi: HmiNow,
    kind: Literal["calibration", "verification"],
    name: Literal["area.png", "field.png"],
) -> Response:
    """Send a plot of the calibration in force."""
    reply = await hmi.gateway.request(GetCalibration(), CalibrationState, deadline_s=SLOW_DEADLINE_S)
    record = reply.calibration if kind == "calibration" else reply.verification
    if record is None or name not in record.pictures:
        raise Problem(404, "problem.not_found")
    return FileResponse(Path(record.folder) / name)


@router.post("/sensor/begin")
async def begin(
    hmi: HmiNow,
    caller: Maintainer,
    kind: Annotated[Literal["calibration", "verification"], Form()],
    places: Annotated[str, Form(max_length=200)] = "",
) -> Response:
    """Begin a run; places are given one per line, as `4; 0`."""
    parsed = [_PLACE.match(line) for line in places.splitlines() if line.strip()]
    if len(parsed) > 6 or not all(parsed):
        raise Problem(400, "problem.bad_form")
    wanted = tuple((_mm(each[1]), _mm(each[2])) for each in parsed if each)
    query = StartCalibrationRun(kind=kind, places=wanted, actor=actor_of(caller))
    await hmi.gateway.request(query, CalibrationRunView, deadline_s=SLOW_DEADLINE_S)
    return go_to("/maintenance/sensor")


@router.post("/sensor/go-on")
async def go_on(hmi: HmiNow, caller: Maintainer) -> Response:
    """Confirm that the ball is in place."""
    await hmi.gateway.request(
        ContinueCalibrationRun(actor=actor_of(caller)), CalibrationRunView, deadline_s=SLOW_DEADLINE_S
    )
    return go_to("/maintenance/sensor")


@router.post("/sensor/end")
async def end(hmi: HmiNow, caller: Maintainer) -> Response:
    """Cancel the run."""
    await hmi.gateway.request(EndCalibrationRun(actor=actor_of(caller)), CalibrationRunView, deadline_s=MOVE_DEADLINE_S)
    return go_to("/maintenance/sensor")


@router.post("/sensor/gel-changed")
async def note_gel_change(hmi: HmiNow, caller: Maintainer) -> Response:
    """Note that the gel was changed: no calibration is in force until the next one."""
    await hmi.gateway.request(NoteGelChange(actor=actor_of(caller)), CalibrationState, deadline_s=SLOW_DEADLINE_S)
    return go_to("/maintenance/sensor?gel_changed=yes")


@router.get("/registers")
async def registers(request: Request, hmi: HmiNow) -> Response:
    """Show the PLC's registers by name."""
    return show(request, "maintenance_registers.html.j2", tab="registers", reply=await _registers(hmi))


@router.get("/registers/part")
async def registers_part(hmi: HmiNow, locale: LocaleNow) -> Response:
    """Render the same as a part, for polling."""
    return show_part(hmi, locale, "maintenance_register_table.html.j2", {"reply": await _registers(hmi)})


@router.get("/log")
async def log(request: Request, hmi: HmiNow, level: Annotated[Level, Query()] = "INFO") -> Response:
    """Show the last lines of the station's log."""
    reply = await hmi.gateway.request(ReadLog(limit=LOG_LINES, level=level), Log, deadline_s=SLOW_DEADLINE_S)
    return show(request, "maintenance_log.html.j2", tab="log", lines=reply.lines[::-1], level=level)


def _ended(hmi: Hmi, ticket: int) -> OperatorCommandView | None:
    """Return a command that has ended, once the state that the pages show has its end; None before."""
    commands = () if hmi.gateway.state is None else hmi.gateway.state.orders
    return next((each for each in commands if each.ticket == ticket and each.state != "executing"), None)


async def _health(hmi: Hmi) -> dict[str, Any]:
    return {"health": await hmi.gateway.request(GetHealth(), Health, deadline_s=SLOW_DEADLINE_S)}


def _allowed(values: dict[str, Any]) -> str:
    return "no" if values["health"].jog_refused else "yes"


async def _stepped(hmi: Hmi, step_mm: float) -> float:
    """Return the width a step from where the fingers are."""
    width_mm = (await _health(hmi))["health"].width_mm
    if width_mm is None:
        raise Problem(409, "maintenance.width_unknown")
    return max(0.0, round(width_mm + step_mm, 1))


async def _live(hmi: Hmi, *, contact: bool) -> dict[str, Any]:
    try:
        reply = await hmi.gateway.request(GetLiveImage(contact=contact), LiveImage, deadline_s=_IMAGE_DEADLINE_S)
    except ChannelError as error:
        return {"live_image": None, "why": error.message, "histograms": (), "place": ""}
    place = str(round(1e6 * reply.captured_s)) + ("1" if contact else "0")
    _FRAMES[place] = reply.picture
    while len(_FRAMES) > _KEPT_FRAMES:
        _FRAMES.popitem(last=False)
    drawn = tuple(zip(("red", "green", "blue"), map(histogram, reply.histogram), strict=True))
    is_old = reply.age_s > STALE_S
    return {"live_image": reply, "why": "", "histograms": drawn, "place": place, "is_old": is_old}


async def _calibration(hmi: Hmi) -> dict[str, Any]:
    recipes = await hmi.gateway.request(GetRecipes(), Recipes)
    return {
        "now": await hmi.gateway.request(GetCalibration(), CalibrationState, deadline_s=SLOW_DEADLINE_S),
        "ball": next((each for each in recipes.recipes if each.name == hmi.ball_recipe), None),
    }


async def _registers(hmi: Hmi) -> Registers:
    return await hmi.gateway.request(GetRegisters(), Registers, deadline_s=SLOW_DEADLINE_S)


def _mm(text: str) -> float:
    return float(text.replace(",", "."))
