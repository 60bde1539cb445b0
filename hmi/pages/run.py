"""The page Run: what the station does, what to do next, and the last fruit."""

from fastapi import APIRouter, Request
from starlette.responses import Response

from hmi.navigation import Entry
from hmi.page import show

router = APIRouter()
ENTRY = Entry("run", "/")


@router.get("/")
async def run(request: Request) -> Response:
    """The page."""
    return show(request, "run.html.j2")
