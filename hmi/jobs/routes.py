"""Job pages: progress and files of exports, reports and what-ifs."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request
from pydantic import StringConstraints
from starlette.responses import FileResponse, Response

from hmi.jobs.queue import JobFile
from hmi.web.access import GenuineCaller, HmiNow, LocaleNow, at_panel, caller_of, known
from hmi.web.context import Hmi
from hmi.web.page import go_to, show, show_part
from hmi.web.problem import Problem
from hmi.web.security import POLICY

router = APIRouter(prefix="/jobs")
SHOWN_POLICY = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'self'"
"""For a document that a job has written: it runs nothing, and fetches nothing."""

JobId = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{32}$")]
FileName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_.-]{1,64}$")]
Back = Annotated[str, Query(max_length=200, pattern=r"^/([A-Za-z0-9_][A-Za-z0-9_/-]*)?$")]


async def logged_in(request: Request) -> None:
    """Require a log-in for files: an export holds all data of the station."""
    known(caller_of(request))


@router.get("/{job}")
async def job(request: Request, hmi: HmiNow, job: JobId, back: Back = "/history") -> Response:
    """Show a job."""
    return show(request, "job.html.j2", job=hmi.jobs.get(job), back=back)


@router.get("/{job}/part")
async def part(request: Request, hmi: HmiNow, locale: LocaleNow, job: JobId, back: Back = "/history") -> Response:
    """Render the same as a part of the page, for polling."""
    found = hmi.jobs.get(job)
    values = {"job": found, "back": back, "on_panel": at_panel(request)}
    return show_part(hmi, locale, "job_part.html.j2", values, {"x-over": "" if found.open else "1"})


@router.post("/{job}/end")
async def end(hmi: HmiNow, caller: GenuineCaller, job: JobId) -> Response:
    """Cancel a job."""
    known(caller)
    await hmi.jobs.end(job)
    return go_to(f"/jobs/{job}")


@router.get("/{job}/file/{name}", dependencies=[Depends(logged_in)])
async def file(hmi: HmiNow, job: JobId, name: FileName) -> Response:
    """Send one of its files for download."""
    return _sent(_file(hmi, job, name), {"content-disposition": f'attachment; filename="{name}"'})


@router.get("/{job}/show/{name}", dependencies=[Depends(logged_in)])
async def display(request: Request, hmi: HmiNow, job: JobId, name: FileName, back: Back = "/history") -> Response:
    """Show one of its documents within a page: a panel's browser has no other way back from it."""
    found = hmi.jobs.get(job)
    _document(hmi, job, name)
    answer = show(request, "job_document.html.j2", job=found, name=name, back=back)
    answer.headers["content-security-policy"] = f"{POLICY}; frame-src 'self'"
    return answer


@router.get("/{job}/document/{name}", dependencies=[Depends(logged_in)])
async def document(hmi: HmiNow, job: JobId, name: FileName) -> Response:
    """Send one of its documents for display in the browser."""
    found = _document(hmi, job, name)
    return _sent(found, {"content-security-policy": SHOWN_POLICY, "content-disposition": "inline"})


def _document(hmi: Hmi, job: str, name: str) -> JobFile:
    if not name.endswith(".html"):
        raise Problem(404, "problem.not_found")
    return _file(hmi, job, name)


def _file(hmi: Hmi, job: str, name: str) -> JobFile:
    found = next((each for each in hmi.jobs.get(job).files if each.path.name == name), None)
    if found is None:
        raise Problem(404, "problem.not_found")
    return found


def _sent(file: JobFile, headers: dict[str, str]) -> Response:
    return FileResponse(file.path, media_type=file.media_type, headers=headers)
