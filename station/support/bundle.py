"""Support bundle: one ZIP file with versions, configuration, recipes, logs, recent inspections and alarms.

Nothing secret is in it by construction: only what is listed here is written. Passwords, PINs, tokens and keys are in
files of their own, which nothing here reads; the configuration holds only their paths. Images are left out for their
size, the file of people and the audit trail because they are personal. Logs and alarms name people all the same:
support needs them.
"""

import contextlib
import json
import os
import platform
import shutil
import subprocess
import sys
import urllib.request
import zipfile
from collections.abc import Callable, Iterator
from http.client import HTTPException
from importlib.metadata import distributions, version
from pathlib import Path
from typing import IO

from station.clock import formatted, utc_ms
from station.errors import StationError
from station.records.database import reading, records_folder
from station.records.last_backup import last_backup_utc_s
from station.records.queries import read_alarm_log, read_alarms, read_inspection
from station.records.report import format_inspection, format_list
from station.records.search import Query, find_page
from station.settings.configuration import Configuration
from station.settings.recipe import recipe_files

LOG_BYTES = 2_000_000
"""Of the end of each log file."""
_JOURNAL_LINES, _JOURNAL_LIMIT_S = 10_000, 30.0
_INSPECTIONS_LISTED, _INSPECTIONS_WHOLE, _ALARMS = 200, 20, 1_000
_ANSWER_LIMIT_S = 2.0


def bundle(site: Configuration, broken: str, target: Path | IO[bytes]) -> tuple[str, ...]:
    """Write the bundle; a part that cannot be had is replaced by the reason, as a station in trouble has few parts.

    Args:
        site: the last good configuration where the present one is broken.
        broken: the error in the present configuration's files; empty for none.
        target: the ZIP file.

    Returns:
        The names of the parts.

    Raises:
        OSError: the file cannot be written.
    """
    parts = dict(_parts(site, broken))
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, make in parts.items():
            archive.writestr(name, _made(make))
    return tuple(parts)


def _made(make: Callable[[], str | bytes]) -> str | bytes:
    try:
        return make()
    except (StationError, OSError, ValueError, HTTPException, subprocess.TimeoutExpired) as error:
        return f"not available: {error}\n"


def _parts(site: Configuration, broken: str) -> Iterator[tuple[str, Callable[[], str | bytes]]]:
    """Yield each part's name with the function that makes it."""
    yield "about.txt", lambda: _about(site.home)
    yield "packages.txt", _packages
    yield "configuration.json", lambda: site.model_dump_json(indent=2)
    if broken:
        yield "configuration_error.txt", lambda: f"{broken}\n"
    with contextlib.suppress(StationError):  # no folder of recipes: the readiness says so
        for file in recipe_files(site.recipes_folder):
            yield f"recipes/{file.name}", file.read_bytes
    for page in ("readyz", "metrics"):
        yield f"{page}.txt", lambda page=page: _answer(site, page)
    for file in sorted((site.home / "logs").glob("*.log")):
        yield f"logs/{file.name}", lambda file=file: _end_of(file)
    yield "logs/journal.txt", _journal
    folder = records_folder(site.home)
    yield "alarms.json", lambda: _alarms(folder)
    yield "inspections.txt", lambda: _inspections(folder)


def _about(home: Path) -> str:
    disk = shutil.disk_usage(home)
    return (
        f"made         {formatted(utc_ms())}\n"
        f"station      {version('fruit-station')}\n"
        f"Python       {sys.version.split()[0]}\n"
        f"system       {platform.platform()}\n"
        f"processors   {os.cpu_count()}\n"
        f"home         {home}\n"
        f"disk         {disk.free / 1e9:.1f} GB free of {disk.total / 1e9:.1f} GB\n"
        f"backup       {formatted(int(1000 * last)) if (last := last_backup_utc_s(home)) else 'never'}\n"
    )


def _packages() -> str:
    return "".join(sorted(f"{each.name}=={each.version}\n" for each in distributions()))


def _answer(site: Configuration, page: str) -> str:
    """Return what the running station answers; "not ready" is an answer too."""
    address = f"http://{site.metrics.host}:{site.metrics.port}/{page}"
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}), _KeepError())
    with opener.open(address, timeout=_ANSWER_LIMIT_S) as answer:
        return answer.read().decode("utf-8", "replace")


class _KeepError(urllib.request.HTTPErrorProcessor):
    """Gives an answer of any status to the caller."""

    def http_response(self, request: urllib.request.Request, response: object) -> object:
        """Return the answer as it is."""
        return response


def _end_of(file: Path) -> bytes:
    with file.open("rb") as opened:
        opened.seek(max(0, file.stat().st_size - LOG_BYTES))
        return opened.read()


def _journal() -> str:
    """Return the end of an installed station's log, which its unit writes to the system's journal."""
    command = ["journalctl", "--no-pager", "--output=short-iso", f"--lines={_JOURNAL_LINES}"]
    command += [f"--unit={unit}" for unit in ("fruit-station", "fruit-station-backup")]
    done = subprocess.run(  # noqa: S603 (no argument is from outside)
        command, capture_output=True, text=True, errors="replace", timeout=_JOURNAL_LIMIT_S, check=False
    )
    return (done.stdout + done.stderr)[-LOG_BYTES:]


def _alarms(folder: Path) -> str:
    with reading(folder) as connection:
        active, log = read_alarms(connection), read_alarm_log(connection, _ALARMS).values()
    return json.dumps({"active": list(map(str, active)), "log": list(map(str, log))}, indent=1)


def _inspections(folder: Path) -> str:
    with reading(folder) as connection:
        rows = find_page(connection, Query(), _INSPECTIONS_LISTED).rows
        whole = [read_inspection(connection, row.sequence, folder) for row in rows[:_INSPECTIONS_WHOLE]]
    return "\n\n".join([format_list(rows), *map(format_inspection, whole)])
