"""Job pages: progress and files of exports, reports and what-ifs."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Request
from pydantic import StringConstraints
from starlette.responses import FileResponse, Response

from hmi.web.access import GenuineCaller, HmiNow, LocaleNow, caller_of, known
from hmi.web.context import Hmi
from hmi.web.page import go_to, show, show_part
from hmi.web.problem import Problem

router = APIRouter(prefix="/jobs")
SHOWN_POLICY = "sandbox; default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"
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
async def part(hmi: HmiNow, locale: LocaleNow, job: JobId) -> Response:
    """Render the same as a part of the page, for polling."""
    found = hmi.jobs.get(job)
    return show_part(hmi, locale, "job_part.html.j2", {"job": found}, {"x-over": "" if found.open else "1"})


@router.post("/{job}/end")
async def end(hmi: HmiNow, caller: GenuineCaller, job: JobId) -> Response:
    """Cancel a job."""
    known(caller)
    await hmi.jobs.end(job)
    return go_to(f"/jobs/{job}")


@router.get("/{job}/file/{name}", dependencies=[Depends(logged_in)])
async def file(hmi: HmiNow, job: JobId, name: FileName) -> Response:
    """Send one of its files for download."""
    return _sent(hmi, job, name, {"content-disposition": f'attachment; filename="{name}"'})


@router.get("/{job}/show/{name}", dependencies=[Depends(logged_in)])
async def display(hmi: HmiNow, job: JobId, name: FileName) -> Response:
    """Send one of its documents for display in the browser."""
    if not name.endswith(".html"):
        raise Problem(404, "problem.not_found")
    return _sent(hmi, job, name, {"content-security-policy": SHOWN_POLICY, "content-disposition": "inline"})


def _sent(hmi: Hmi, job: str, name: str, headers: dict[str, str]) -> Response:
    found = next((each for each in hmi.jobs.get(job).files if each.path.name == name), None)
    if found is None:
        raise Problem(404, "problem.not_found")
    return FileResponse(found.path, media_type=found.media_type, headers=headers)
