"""Cost of the operators' pages: a first load, the processor with three clients at 10 Hz, and the PLC's latency.

Run with `./run bench hmi [SECONDS] [--rounds N]`: a whole demonstration with fruit after fruit; no client, three
panels take the page Run, ten readers page through the history and its images, three headless Chromiums show the page
Run on the same cores, and then the same page made with NiceGUI, in turn in every round. Writes `docs/hmi-speed.md`.
With `--pictures` it only draws the pages into `docs/images/hmi-*.png`.
"""

import argparse
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import psutil
from bench_plc import built
from hmi_load.peer import nicegui, peer_browsers
from hmi_load.pictures import draw
from hmi_load.rounds import (
    BROWSERS,
    HISTORY_READERS,
    NO_CLIENT,
    PANEL_COUNT,
    PANELS,
    PEER,
    READERS,
    Round,
    browsers,
    clients,
    compared,
    conditions_of,
    differences,
    plc_reader,
    table,
)
from monitoring.ports import free_port
from playwright.sync_api import Browser, sync_playwright

from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import address_of

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "docs" / "hmi-speed.md"
HOST = "127.83.0.1"
REFRESH_S, ROUNDS, SECONDS = 0.1, 9, 12.0
FRUIT_FIRST, START_S = 8, 400.0
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
CHROMIUM = shutil.which("chromium") or "/usr/bin/chromium"


OWN_PICTURE, PEER_PICTURE = "img.fruit-picture", ".fruit-picture img"


class Load(NamedTuple):
    """A first load of the page Run, with nothing cached from before."""

    transferred_bytes: int
    requests: int
    shown_s: float

    @property
    def row(self) -> str:
        """Its line of the table, without its name."""
        return f"{self.transferred_bytes / 1000:.0f} | {self.requests} | {self.shown_s:.1f}"


class Demo(NamedTuple):
    """The running demonstration."""

    site: Configuration
    configuration: Path
    """The file that `site` is from."""
    process: subprocess.Popen[bytes]
    log: Path
    console: int
    """The twin's."""

    def part(self, name: str) -> psutil.Process:
        """One of its processes."""
        for child in psutil.Process(self.process.pid).children(recursive=True):
            if f"-m station {name}" in " ".join(child.cmdline()):
                return child
        raise SystemExit(f"the demonstration has no process {name}")

    def fruit(self) -> int:
        """Count the fruit in the demonstration's log."""
        return sum(line[:1].isdigit() for line in self.log.read_text(encoding="utf-8").splitlines())


@contextlib.contextmanager
def demo(first: int = FRUIT_FIRST, **settings: dict[str, Any]) -> Iterator[Demo]:
    """A demonstration on addresses of its own, once it has inspected some fruit.

    Args:
        first: number of fruit to wait for.
        settings: by section, beside those of every demonstration here.
    """
    modbus, metrics, hmi, camera, console = (free_port() for _ in range(5))
    with tempfile.TemporaryDirectory() as folder:
        file, log = Path(folder) / "station.yaml", Path(folder) / "demo.log"
        values: dict[str, dict[str, Any]] = {
            "modbus": {"port": modbus},
            "metrics": {"port": metrics},
            "hmi": {"port": hmi, "refresh_s": REFRESH_S, "idle_s": 3600.0},
            "arm": {"host": HOST, "stale_after_s": 1.0},
            "gripper": {"urcap": {"host": HOST}, "modbus_rtu": {"host": HOST}, "answer_timeout_s": 2.0},
            "camera": {"oldest_s": 2.0, "twin": {"port": camera}},
            "service": {"patience": 5.0, "inspection_deadline_s": 30.0},
        }
        values = {name: {**values.get(name, {}), **settings.get(name, {})} for name in {*values, *settings}}
        file.write_text(json.dumps(values), encoding="utf-8")
        environment = {
            **os.environ, "STATION_HOME": folder, "STATION_CONFIG": str(file), "OMP_NUM_THREADS": "1", "COLUMNS": "200",
        }  # fmt: skip
        command = [sys.executable, "-m", "station", "demo", "--console", str(console), "--speed", "12"]
        with log.open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=output, env=environment)
        running = Demo(load_configuration(file, {"STATION_HOME": folder}), file, process, log, console)
        try:
            until(lambda: running.fruit() >= first or process.poll() is not None)
            if process.poll() is not None:
                raise SystemExit(log.read_text(encoding="utf-8"))
            yield running
        finally:
            process.terminate()
            process.wait(60)


def until(what: Callable[[], Any]) -> None:
    """Wait until something is so."""
    deadline_s = time.monotonic() + START_S
    while not what():
        if time.monotonic() > deadline_s:
            raise SystemExit(f"it did not come about within {START_S:g} s")
        time.sleep(0.05)


def first_load(browser: Browser, address: str, shown: str) -> Load:
    """The page Run in a browser that has never seen it.

    Args:
        browser: to load it.
        address: of the page.
        shown: selects the fruit's picture.
    """
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    sizes: list[float] = []
    page.context.new_cdp_session(page).send("Network.enable")
    watching = page.context.new_cdp_session(page)
    watching.send("Network.enable")
    watching.on("Network.loadingFinished", lambda event: sizes.append(event["encodedDataLength"]))
    began_s = time.monotonic()
    page.goto(address)
    picture = page.locator(shown).first
    until(lambda: picture.count() and picture.evaluate("picture => picture.naturalWidth"))
    shown_s = time.monotonic() - began_s
    page.wait_for_timeout(500)
    context.close()
    return Load(round(sum(sizes)), len(sizes), shown_s)


def written(load: Load, peer: Load, found: dict[str, list[Round]], conditions: str) -> str:
    """The document."""
    introduction = (
        "Written by `./run bench hmi`: a demonstration with fruit after fruit, the page Run updated "
        f"{1 / REFRESH_S:.0f} times a second. Three panels: clients in a process of their own that read the page's "
        "stream and fetch its pictures, as separate panel computers do. Ten readers: likewise, each opens a page of "
        "the history or a fruit with all its images every second. Three browsers: headless "
        "Chromium that renders the pages on the station's own cores, the worst case. NiceGUI's page: the peer, with "
        "the same figures, charts and picture, updated as often from the same channel, by a process of its own; the "
        "station's pages are served beside it, to nobody."
    )
    first = [
        "| first load of the page Run | kB | requests | picture displayed after, s |",
        "|---|---|---|---|",
        f"| this page | {load.row} |",
        f"| NiceGUI's page | {peer.row} |",
    ]
    lines = ["# Cost of the operators' pages", "", introduction, "", *table(found), "", *differences(found)]
    return "\n".join([*lines, "", *first, "", conditions, ""])


def measure(running: Demo, browser: Browser, rounds: int, seconds: float) -> str:
    """All of it; gives the document."""
    host, port = running.site.hmi.host, running.site.hmi.port
    load = first_load(browser, address_of(running.site.hmi), OWN_PICTURE)
    with nicegui(running.configuration) as (_, address):
        peer = first_load(browser, address, PEER_PICTURE)
    parts = {name: running.part(name) for name in ("hmi", "service")}
    who: dict[str, Callable[[], contextlib.AbstractContextManager[Any]]] = {
        NO_CLIENT: contextlib.nullcontext,
        PANELS: lambda: clients("panels", PANEL_COUNT, host, port),
        READERS: lambda: clients("readers", HISTORY_READERS, host, port),
        BROWSERS: lambda: browsers(browser, host, port),
        PEER: lambda: peer_browsers(browser, running.configuration, PANEL_COUNT),
    }
    metrics = f"http://{running.site.metrics.host}:{running.site.metrics.port}/metrics"
    with tempfile.TemporaryDirectory() as folder:
        plc = plc_reader(built("load", Path(folder)), running.site.modbus.port)
        found = compared(who, parts, plc, metrics, rounds, seconds)
    return written(load, peer, found, conditions_of(rounds, seconds))


def main() -> int:
    """Measure or draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", nargs="?", type=float, default=SECONDS, help="for each condition in each round")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="fewer try it only, and write no document")
    parser.add_argument("--pictures", action="store_true", help="only draw the pages")
    options = parser.parse_args()
    with demo() as running, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        if options.pictures:
            draw(address_of(running.site.hmi), running.part("hmi"), browser, running.console)
        else:
            text = measure(running, browser, options.rounds, options.seconds)
            print(text)
            if options.rounds >= ROUNDS:
                DOCUMENT.write_text(text, encoding="utf-8")
        browser.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
