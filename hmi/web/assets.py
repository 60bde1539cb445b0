"""Static files of the pages: scripts, styles and icons, held in memory; nothing is fetched from outside."""

import gzip
import hashlib
from typing import NamedTuple

from starlette.requests import Request
from starlette.responses import Response

from hmi.web.folders import FOLDERS, HMI
from station.charts.area_chart import STYLE_FILE

_KINDS = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml"}
_FOR_EVER = "public, max-age=31536000, immutable"


class Asset(NamedTuple):
    """One file."""

    plain: bytes
    zipped: bytes
    kind: str
    digest: str
    """Of its content: its address changes with it, so that a browser may keep it for ever."""


class Assets:
    """Scripts, styles and icons of all pages' folders, and the charts' style; their names are unique."""

    def __init__(self) -> None:
        self._files = {
            path.name: Asset(
                data := path.read_bytes(),
                gzip.compress(data, 9, mtime=0),
                _KINDS[path.suffix],
                hashlib.sha256(data).hexdigest()[:12],
            )
            for path in (STYLE_FILE, *(path for folder in FOLDERS for path in sorted((HMI / folder).iterdir())))
            if path.suffix in _KINDS
        }

    def address(self, name: str) -> str:
        """Return the address of a file.

        Raises:
            KeyError: there is no such file.
        """
        return f"/static/{self._files[name].digest}/{name}"

    def serve(self, request: Request) -> Response:
        """Answer `/static/{digest}/{name}`."""
        found = self._files.get(request.path_params["name"])
        if found is None or found.digest != request.path_params["digest"]:
            return Response(status_code=404)
        zipped = "gzip" in request.headers.get("accept-encoding", "")
        headers = {"cache-control": _FOR_EVER, "vary": "accept-encoding"} | (
            {"content-encoding": "gzip"} if zipped else {}
        )
        return Response(found.zipped if zipped else found.plain, headers=headers, media_type=found.kind)
