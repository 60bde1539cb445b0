"""The HTTP API for a plant's own systems: results, recipes, lots, health. Described at `/api/openapi.json`."""

import re
from datetime import UTC, datetime
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Path, Query
from pydantic import BeforeValidator
from starlette.convertors import Convertor, register_url_convertor

from hmi.api.access import changer, reader
from hmi.api.model import (
    AlarmAnswers,
    Error,
    HealthAnswer,
    InspectionDetails,
    InspectionList,
    InspectionSummary,
    LotAnswer,
    LotBegin,
    LotList,
    LotName,
    RecipeDetails,
    RecipeList,
    RecipeSummary,
)
from hmi.past.past import UnknownInspectionError
from hmi.past.recipes import RecipeState
from hmi.web.access import HmiNow
from hmi.web.gateway import SLOW_DEADLINE_S
from hmi.web.roles import Right
from station.channel.panel import Actor, AlarmList, ListAlarms
from station.channel.panel_lots import EndLot, LotView, Search, StartLot
from station.channel.panel_maintenance import GetHealth, Health
from station.vocabulary import LONGEST_LOT, OutcomeName, Reason

IN_SCHEMA = True
_DATE = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}")
_TEXT = {"text/plain": {"schema": {"type": "string"}}}
_REFUSED: dict[int | str, dict[str, Any]] = {
    401: {"model": Error, "description": "Neither a known token nor a person who is logged in."},
    403: {"model": Error, "description": "Forbidden, or sent by a foreign page.", "content": _TEXT},
    409: {"model": Error, "description": "The station refused, or the records cannot be read; the detail says why."},
    413: {"description": "The request is too large.", "content": _TEXT},
    421: {"description": "The request is for a name that is not this station's.", "content": _TEXT},
    503: {"model": Error, "description": "The station gave no answer in time."},
}
_NOT_FOUND: dict[int | str, dict[str, Any]] = {404: {"model": Error, "description": "There is none."}}
_UNREADABLE: dict[int | str, dict[str, Any]] = {400: {"model": Error, "description": "The body cannot be read."}}


def _written_as_date(text: str) -> str:
    if not _DATE.match(text):
        raise ValueError("give a date and time of ISO 8601, as 2026-11-23T08:00:00Z")
    return text


class _LotNames(Convertor[str]):
    """Lots' names in a path: also those with a slash, but for one that ends in `/end`, which is an order."""

    regex = "(?:(?!/end$).)+"

    def convert(self, value: str) -> str:
        return value

    def to_string(self, value: str) -> str:
        return value


register_url_convertor("lot", _LotNames())
router = APIRouter(prefix="/api/v1", responses=_REFUSED)
Reader = Annotated[Actor, Depends(reader)]
LotChanger = Annotated[Actor, Depends(changer(Right.RUN))]
Text = Annotated[str, Query(min_length=1, max_length=64, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")]
Moment = Annotated[datetime, BeforeValidator(_written_as_date)]
"""A number is refused: it does not state whether it counts seconds or milliseconds."""
RecipeName = Annotated[str, Path(pattern=r"^[a-z][a-z0-9_]{0,31}$")]
Sequence = Annotated[int, Path(ge=1, lt=2**32)]
EARLIEST, LATEST = datetime(1970, 1, 1, tzinfo=UTC), datetime(9999, 1, 1, tzinfo=UTC)


@router.get("/health", tags=["health"])
async def health(hmi: HmiNow, _: Reader) -> HealthAnswer:
    """Readiness of the station, and the state of each of its parts."""
    reply = await hmi.gateway.request(GetHealth(), Health, deadline_s=SLOW_DEADLINE_S)
    return HealthAnswer.model_validate(reply)


@router.get("/alarms", tags=["health"])
async def alarms(hmi: HmiNow, _: Reader) -> AlarmAnswers:
    """Alarms that are not in their normal state."""
    reply = await hmi.gateway.request(ListAlarms(), AlarmList, deadline_s=SLOW_DEADLINE_S)
    return AlarmAnswers.model_validate(reply)


@router.get("/inspections", tags=["results"])
async def inspections(
    hmi: HmiNow,
    _: Reader,
    lot: Annotated[str | None, Query(max_length=LONGEST_LOT, pattern=r"^[^\x00-\x1f\x7f-\x9f]*$")] = None,
    grower: Text | None = None,
    fruit: Text | None = None,
    outcome: OutcomeName | None = None,
    reason: Reason | None = None,
    begun_from: Annotated[Moment | None, Query(alias="from", description="Begun then or later.")] = None,
    begun_to: Annotated[Moment | None, Query(alias="to", description="Begun before then.")] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 50,
    below: Annotated[int | None, Query(ge=1, le=2**32, description="From the page before.")] = None,
) -> InspectionList:
    """Inspections, newest first, one page at a time; all given conditions have to be met."""
    search = Search(
        lot=lot,
        grower=grower,
        fruit=fruit,
        outcome=outcome,
        reason=reason,
        from_utc_ms=_utc_ms(begun_from),
        to_utc_ms=_utc_ms(begun_to),
    )
    page = await hmi.past.find(search, limit, below)
    return InspectionList(inspections=[InspectionSummary.model_validate(row) for row in page.rows], below=page.below)


@router.get("/inspections/{sequence}", tags=["results"], responses=_NOT_FOUND)
async def inspection(hmi: HmiNow, _: Reader, sequence: Sequence) -> InspectionDetails:
    """One inspection with its curve."""
    try:
        reply = await hmi.past.inspection(sequence)
    except UnknownInspectionError as error:
        raise HTTPException(404, str(error)) from error
    return InspectionDetails.of(reply)


@router.get("/recipes", tags=["recipes"])
async def recipes(hmi: HmiNow, _: Reader) -> RecipeList:
    """The state of every recipe."""
    return RecipeList(recipes=[RecipeSummary(**_summary(state)) for state in (await hmi.past.recipes.read()).states])


@router.get("/recipes/{name}", tags=["recipes"], responses=_NOT_FOUND)
async def recipe(hmi: HmiNow, _: Reader, name: RecipeName) -> RecipeDetails:
    """One recipe, with the values in force."""
    found = next((each for each in (await hmi.past.recipes.read()).states if each.name == name), None)
    if found is None:
        raise HTTPException(404, f"there is no recipe {name}; /api/v1/recipes lists them")
    values = found.control.recipe.model_dump(mode="json") if found.control else None
    return RecipeDetails(**_summary(found), values=values)


@router.get("/lots", tags=["lots"])
async def lots(hmi: HmiNow, _: Reader, limit: Annotated[int, Query(ge=1, le=100)] = 20) -> LotList:
    """The latest lots."""
    return LotList(lots=[LotAnswer.model_validate(each) for each in await hmi.past.lots(limit)])


@router.get("/lots/{name:lot}", tags=["lots"], responses=_NOT_FOUND)
async def lot(hmi: HmiNow, _: Reader, name: Annotated[LotName, Path()]) -> LotAnswer:
    """One lot."""
    found = await hmi.past.lots(name=name)
    if not found:
        raise HTTPException(404, f"there is no lot {name}; /api/v1/lots lists the latest")
    return LotAnswer.model_validate(found[0])


@router.put("/lots/{name:lot}", tags=["lots"], responses=_UNREADABLE)
async def begin_lot(hmi: HmiNow, actor: LotChanger, name: Annotated[LotName, Path()], begin: LotBegin) -> LotAnswer:
    """Begin a lot, by the name that the PLC gives with each trigger. Idempotent."""
    query = StartLot(name=name, grower=begin.grower, actor=actor)
    return LotAnswer.model_validate(await hmi.gateway.request(query, LotView, deadline_s=SLOW_DEADLINE_S))


@router.post("/lots/{name:lot}/end", tags=["lots"], responses=_NOT_FOUND)
async def end_lot(hmi: HmiNow, actor: LotChanger, name: Annotated[LotName, Path()]) -> LotAnswer:
    """End a lot. Idempotent."""
    if not await hmi.past.lots(name=name):
        raise HTTPException(404, f"there is no lot {name}; begin it first with PUT /api/v1/lots/NAME")
    query = EndLot(name=name, actor=actor)
    return LotAnswer.model_validate(await hmi.gateway.request(query, LotView, deadline_s=SLOW_DEADLINE_S))


def _summary(state: RecipeState) -> dict[str, Any]:
    return {
        "name": state.name,
        "title": state.title,
        "plc_number": state.recipe and state.recipe.plc_number,
        "revision": state.control and state.control.revision,
        "waiting": state.submitted and state.submitted.revision,
    }


def _utc_ms(at: datetime | None) -> int | None:
    """Return ms since 1970; a time without an offset is UTC."""
    if at is None:
        return None
    known = at if at.tzinfo else at.replace(tzinfo=UTC)
    return round(1000 * min(max(known, EARLIEST), LATEST).timestamp())
