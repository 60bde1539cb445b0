"""History page: search, one inspection with all images and stages, exports and reports, the audit trail."""

import json
from collections import OrderedDict
from datetime import datetime
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Form, Query, Request
from markupsafe import Markup
from pydantic import StringConstraints
from starlette.responses import Response

from hmi.common.charts import area_over_closing, deciding_limit, mark_decided
from hmi.history.audit_sentences import sentence
from hmi.history.chips import chips, days, unseen
from hmi.history.export_options import check_text, options_of
from hmi.past.past import FullRecord, Page, Stages, judged_of
from hmi.web.access import GenuineCaller, HmiNow, LocaleNow, caller_of, known
from hmi.web.context import Hmi
from hmi.web.gateway import SLOW_DEADLINE_S, actor_of
from hmi.web.navigation import Entry
from hmi.web.page import go_to, show
from hmi.web.problem import Problem
from hmi.web.translation import Locale
from station.channel.line import Noted
from station.channel.panel_lots import NoteExport, Search
from station.charts.area_chart import Curve, Limit, Mark
from station.charts.spark import spark
from station.messages.reasons import reason_message
from station.vocabulary import Reason

router = APIRouter(prefix="/history")
ENTRY = Entry("history", "/history")
PAGE = 20
_AUDIT_PAGE = 100
_OUTCOMES = {"PASS": "pass", "FAIL": "fail", "NO_RESULT": "unjudged"}
_LONGEST_GAP = 50
"""Numbers that are searched for the next fruit. An estimate."""
_LARGEST_STEP = 1000
"""Upper limit of a step's number in an address; a recipe has at most 100 steps."""
_KEPT_STAGES = 3
_BETWEEN_DIGITS = str.maketrans("", "", " ,.'\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}\N{THIN SPACE}")
"""Separators of a number such as 4,711."""
_FOR_EVER = {"cache-control": "private, max-age=31536000, immutable"}

Words = Annotated[str, Query(max_length=64)]


def search_of(
    lot: str, grower: str, fruit: str, outcome: str, reason: str, begun_from: str, begun_to: str
) -> Search | None:
    """Parse a search form; None if a value is invalid."""
    try:
        return Search(
            lot=lot or None,
            grower=grower or None,
            fruit=fruit or None,
            outcome=outcome or None,  # pyrefly: ignore[bad-argument-type] (checked by the model)
            reason=Reason(reason) if reason else None,
            from_utc_ms=_utc_ms(begun_from),
            to_utc_ms=_utc_ms(begun_to),
        )
    except (ValueError, OverflowError):
        return None


@router.get("")
async def search(
    request: Request,
    hmi: HmiNow,
    locale: LocaleNow,
    lot: Words = "",
    grower: Words = "",
    fruit: Words = "",
    outcome: Words = "",
    reason: Words = "",
    begun_from: Annotated[str, Query(alias="from", max_length=32)] = "",
    begun_to: Annotated[str, Query(alias="to", max_length=32)] = "",
    number: Annotated[str, Query(max_length=16)] = "",
    below: Annotated[int | None, Query(ge=1, le=2**32)] = None,
) -> Response:
    """Show a page of the search's results; for a fruit's number, that fruit."""
    typed = number.translate(_BETWEEN_DIGITS)
    if typed.isascii() and typed.isdigit() and 0 < int(typed) < 2**32:
        return go_to(f"/history/{int(typed)}")
    terms = {"lot": lot, "grower": grower, "fruit": fruit, "outcome": outcome, "reason": reason}
    terms |= {"from": begun_from, "to": begun_to}
    today, current_lot = datetime.now().astimezone(), hmi.gateway.state.lot if hmi.gateway.state else None
    day = days(terms, today)
    wanted = None if typed else search_of(lot, grower, fruit, outcome, reason, begun_from, begun_to)
    found = Page((), None) if wanted is None else await hmi.past.find(wanted, PAGE, below)
    recipes = (await hmi.past.recipes.read()).states
    return show(
        request,
        "history.html.j2",
        status=200 if wanted is not None else 400,
        terms=terms,
        chips=chips(terms, current_lot, today),
        days=day,
        unseen=unseen(terms, current_lot, day),
        bad=wanted is None,
        found=found,
        below=below,
        titles={row.name: row.title for row in recipes},
        outcomes=[(name, locale.text(f"outcome.{key}")) for name, key in _OUTCOMES.items()],
        fruit=[(row.name, locale.title(row.title)) for row in recipes],
        reasons=[(reason, locale.text(f"reason.{reason}")) for reason in Reason],
        spark=spark,
        may_export=bool(caller_of(request).name),
    )


@router.post("/export")
async def export(
    hmi: HmiNow,
    caller: GenuineCaller,
    form: Annotated[Literal["csv", "parquet"], Form()],
    lot: Annotated[str, Form(max_length=64)] = "",
    grower: Annotated[str, Form(max_length=64)] = "",
    fruit: Annotated[str, Form(max_length=64)] = "",
    outcome: Annotated[str, Form(max_length=64)] = "",
    reason: Annotated[str, Form(max_length=64)] = "",
    begun_from: Annotated[str, Form(alias="from", max_length=32)] = "",
    begun_to: Annotated[str, Form(alias="to", max_length=32)] = "",
) -> Response:
    """Export the search's results as a table."""
    wanted = search_of(lot, grower, fruit, outcome, reason, begun_from, begun_to)
    if wanted is None:
        raise Problem(400, "problem.bad_form")
    actor, options, folder = actor_of(known(caller)), options_of(wanted), hmi.jobs.folder()
    await hmi.gateway.request(NoteExport(search=wanted, actor=actor), Noted, deadline_s=SLOW_DEADLINE_S)
    job = hmi.jobs.begin("export", folder, ["records", "export", str(folder / f"inspections.{form}"), *options])
    return go_to(f"/jobs/{job.id}?back=/history")


@router.post("/report")
async def report(hmi: HmiNow, caller: GenuineCaller, lot: Annotated[str, Form(max_length=32)]) -> Response:
    """Start a lot's report."""
    known(caller)
    check_text(lot)
    folder = hmi.jobs.folder()
    job = hmi.jobs.begin("lot_report", folder, ["records", "report", "--", lot, str(folder / "lot.html")])
    return go_to(f"/jobs/{job.id}?back=/history")


@router.get("/audit")
async def audit(
    request: Request,
    hmi: HmiNow,
    locale: LocaleNow,
    action: Words = "",
    subject: Words = "",
    below: Annotated[int | None, Query(ge=1, le=2**53)] = None,
) -> Response:
    """Show a page of the audit trail's rows, as sentences."""
    found, older = await hmi.past.audit(_AUDIT_PAGE, action, subject, below)
    recipes = (await hmi.past.recipes.read()).states
    fruit = {each.recipe.plc_number: each.title for each in recipes if each.recipe is not None}
    rows = [(row, sentence(row, fruit, locale)) for row in found]
    terms = {"action": action, "subject": subject}
    return show(request, "history_audit.html.j2", rows=rows, terms=terms, below=below, older=older)


@router.get("/image/{sha256}.png")
async def image(hmi: HmiNow, sha256: Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]) -> Response:
    """Send a stored image; its address is its content hash, so the browser fetches it once."""
    return Response(await hmi.past.image(sha256), media_type="image/png", headers=_FOR_EVER)


@router.get("/{sequence}")
async def inspection(request: Request, hmi: HmiNow, locale: LocaleNow, sequence: int) -> Response:
    """Show one inspection in full."""
    reply = await _inspection(hmi, sequence)
    before, after = await _neighbours(hmi, sequence)
    return show(
        request,
        "inspection.html.j2",
        reply=reply,
        judged=judged_of(reply),
        values=_recipe(reply),
        before=before,
        after=after,
        reasons=[(str(code), reason_message(code)) for code in (reply.standing.reasons if reply.standing else ())],
        limit=deciding_limit(_limits(reply)[0], reply.standing.closing_mm if reply.standing else None),
        chart=_chart(reply, locale),
        steps=_steps(reply),
        reference=next((each for each in reply.images if each.kind == "reference"), None),
    )


@router.get("/{sequence}/step/{step}")
async def step(request: Request, hmi: HmiNow, sequence: int, step: int) -> Response:
    """Show one step: its image, its mask, and the stages of its measurement."""
    reply = await _inspection(hmi, sequence)
    steps = _steps(reply)
    found = next((each for each in steps if each["point"].step == step), None)
    if found is None:
        raise Problem(404, "problem.not_found")
    stages = None
    if found["image"] and any(each.kind == "reference" for each in reply.images):
        stages = await _stages(hmi, sequence, step)
    return show(
        request,
        "inspection_step.html.j2",
        reply=reply,
        step=found,
        stages=stages,
        before=step - 1 if any(each["point"].step == step - 1 for each in steps) else None,
        after=step + 1 if any(each["point"].step == step + 1 for each in steps) else None,
    )


@router.get("/{sequence}/step/{step}/stage/{place}.jpg")
async def stage(hmi: HmiNow, sequence: int, step: int, place: int) -> Response:
    """Send one stage's picture."""
    stages = await _stages(hmi, sequence, step)
    if not 0 <= place < len(stages.pictures):
        raise Problem(404, "problem.not_found")
    return Response(stages.pictures[place][1], media_type="image/jpeg")


_STAGES: OrderedDict[tuple[int, int], Stages] = OrderedDict()
"""The last steps' stages: a page fetches their pictures one by one."""


async def _stages(hmi: Hmi, sequence: int, step: int) -> Stages:
    known = _STAGES.get((sequence, step))
    if known is not None:
        return known
    if not (0 < sequence < 2**32 and 0 <= step <= _LARGEST_STEP):
        raise Problem(404, "problem.not_found")
    reply = await hmi.past.stages(sequence, step)
    _STAGES[sequence, step] = reply
    while len(_STAGES) > _KEPT_STAGES:
        _STAGES.popitem(last=False)
    return reply


async def _inspection(hmi: Hmi, sequence: int) -> FullRecord:
    if not 0 < sequence < 2**32:
        raise Problem(404, "problem.not_found")
    return await hmi.past.inspection(sequence)


async def _neighbours(hmi: Hmi, sequence: int) -> tuple[int | None, int | None]:
    """Return the numbers of the fruit before and after one; None where there is none.

    Numbers can be missing, after a power failure; the gap is passed unless it is longer than what is looked through.
    """
    later = (await hmi.past.find(Search(), _LONGEST_GAP, sequence + _LONGEST_GAP)).rows
    earlier = (await hmi.past.find(Search(), 1, sequence)).rows
    after = min((row.sequence for row in later if row.sequence > sequence), default=None)
    return (earlier[0].sequence if earlier else None), after


def _steps(reply: FullRecord) -> list[dict[str, Any]]:
    """Return every point of the curve, with its image and mask where these are stored."""
    stored = {(each.kind, each.step): each for each in reply.images}
    return [
        {"point": point, "image": stored.get(("step", point.step)), "mask": stored.get(("mask", point.step))}
        for point in judged_of(reply).curve
    ]


def _recipe(reply: FullRecord) -> dict[str, Any] | None:
    """Return the recipe's values as they were then."""
    return json.loads(reply.trigger.recipe.text) if reply.trigger.recipe else None


def _limits(reply: FullRecord) -> tuple[list[Limit], float | None]:
    """Return the limits of the recipe at that time for this fruit's size, and its early stop; none if unknown."""
    factor = float(judged_of(reply).measures.get("limit_factor") or 1.0)
    try:
        recipe = _recipe(reply) or {}
        limits = [
            Limit(each["closing_mm"], factor * each["area_mm2"], factor * each.get("least_area_mm2", 0.0))
            for each in recipe["damage"]["area"]
        ]
        return limits, factor * recipe["early_stop"]["area_mm2"]
    except (KeyError, TypeError):  # of a schema version that this program does not accept
        return [], None


def _chart(reply: FullRecord, locale: Locale) -> Markup | None:
    """Draw the curve with the limits of the recipe at that time."""
    points = [
        (point.closing_mm, point.area_mm2)
        for point in judged_of(reply).curve
        if point.closing_mm is not None and point.area_mm2 is not None and point.closing_mm >= 0
    ]
    if reply.trigger.recipe is None:
        return None
    limits, early = _limits(reply)
    label = locale.text("chart.fruit_label", n=reply.sequence)
    marks: list[Mark] = ["point"] * len(points)
    mark_decided(marks, points, reply.standing.closing_mm if reply.standing else None)
    return area_over_closing([Curve("own", points, marks)], limits, locale, label, early)


def _utc_ms(text: str) -> int | None:
    """Convert a browser's local date and time, in the machine's zone."""
    return round(1000 * datetime.fromisoformat(text).astimezone().timestamp()) if text else None
