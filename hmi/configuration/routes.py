"""Configuration page: `station.yaml` shown and edited as text, checked as `station config check` does."""

import asyncio
import os
from pathlib import Path
from typing import Annotated, NamedTuple

from fastapi import APIRouter, Depends, Form, Request
from starlette.responses import Response

from hmi.configuration.file import changes, digest, former, read_text, replace
from hmi.web.access import HmiNow, may, orders
from hmi.web.context import Hmi
from hmi.web.gateway import actor_of
from hmi.web.page import go_to, show
from hmi.web.problem import Problem
from hmi.web.roles import Right
from hmi.web.sessions import Caller
from station.channel.panel_run import PersonNoted
from station.messages.message import Message
from station.settings.configuration import check_configuration
from station.settings.problems import SettingsError

router = APIRouter(prefix="/maintenance/configuration")
_SAVING = asyncio.Lock()

Admin = Annotated[Caller, Depends(orders(Right.CONFIGURE))]


class Mistake(NamedTuple):
    """One problem of the text."""

    line: int | None
    """Counted from 1; None for a problem of the environment."""
    there: str
    """The line's text."""
    field: Message
    expected: Message


@router.get("", dependencies=[Depends(may(Right.CONFIGURE))])
async def configuration(request: Request, hmi: HmiNow, saved: bool = False) -> Response:  # noqa: FBT001, FBT002
    """Show the file, with its problems."""
    text = read_text(_file(hmi))
    return _page(request, hmi, text, digest(text), _mistakes(text, _file(hmi)), saved=saved)


@router.post("")
async def save(
    request: Request, hmi: HmiNow, caller: Admin, base: Annotated[str, Form()], text: Annotated[str, Form()] = ""
) -> Response:
    """Save the typed text; with a problem it is shown again, and the file stays as it is."""
    return await _saved(request, hmi, caller, text.replace("\r\n", "\n"), base)


@router.post("/former")
async def take_back(request: Request, hmi: HmiNow, caller: Admin, base: Annotated[str, Form()]) -> Response:
    """Put the former file back; the present one becomes the former."""
    return await _saved(request, hmi, caller, read_text(former(_file(hmi))), base)


async def _saved(request: Request, hmi: Hmi, caller: Caller, text: str, base: str) -> Response:
    file = _file(hmi)
    async with _SAVING:
        present = read_text(file)
        if digest(present) != base:
            return _page(request, hmi, text, base, (), wrong="configuration.changed_meanwhile")
        if text == present:
            return _page(request, hmi, text, base, (), wrong="configuration.nothing_changed")
        if mistakes := _mistakes(text, file):
            return _page(request, hmi, text, base, mistakes, wrong="configuration.not_saved")
        try:
            await asyncio.to_thread(replace, file, text)
        except OSError as error:
            return _page(request, hmi, text, base, (), wrong="configuration.not_written", detail=error.strerror or "")
    old, new = changes(present, text)
    note = PersonNoted(person=actor_of(caller), what="configuration_saved", subject=file.name, old=old, new=new)
    await hmi.gateway.note(note)
    return go_to("/maintenance/configuration?saved=true")


def _file(hmi: Hmi) -> Path:
    if hmi.configuration_file is None:
        raise Problem(404, "configuration.no_file")
    return hmi.configuration_file


def _mistakes(text: str, file: Path) -> tuple[Mistake, ...]:
    try:
        check_configuration(text.encode(), file)
    except SettingsError as error:
        lines = text.split("\n")
        found = []
        for each in error.problems:
            line = each.place.parameters.get("line")
            number = line if isinstance(line, int) and line <= len(lines) else None
            found.append(Mistake(number, "" if number is None else lines[number - 1], each.field, each.expected))
        return tuple(found)
    return ()


def _page(
    request: Request,
    hmi: Hmi,
    text: str,
    base: str,
    mistakes: tuple[Mistake, ...],
    *,
    wrong: str = "",
    detail: str = "",
    saved: bool = False,
) -> Response:
    file = _file(hmi)
    return show(
        request,
        "configuration.html.j2",
        status=400 if wrong else 200,
        tab="configuration",
        file=file,
        text=text,
        base=base,
        mistakes=mistakes,
        wrong=wrong,
        detail=detail,
        saved=saved,
        writable=os.access(file.resolve().parent, os.W_OK),
        has_former=former(file).exists(),
    )
