"""What the operators' pages cost: a first load, the processor with three browsers at 10 Hz, and the PLC's latency.

Run with `./run bench hmi [SECONDS]`: a whole demonstration with fruit after fruit, and three pages Run open in a
headless Chromium, against the same demonstration with nobody looking. Writes `docs/hmi-speed.md`. With `--pictures` it
only draws the pages into `docs/images/hmi-*.png`.
"""

import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import psutil
from bench_plc import Figures, built, free_port, measured, middle
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

from station.settings.configuration import Configuration, load_configuration
from station.settings.hmi import address_of

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT, PICTURES = ROOT / "docs" / "hmi-speed.md", ROOT / "docs" / "images"
HOST, PIN = "127.83.0.1", "482915"
BROWSERS, REFRESH_S, ROUNDS = 3, 0.1, 3
SCAN_US = 10_000
FRUIT_FIRST, START_S = 8, 400.0
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
SIZES = {"": (1280, 800), "-phone": (390, 844)}
PAGES = {
    "run": "/",
    "change": "/change",
    "confirm": "/change/2",
    "recipes": "/recipes",
    "recipe": "/recipes/strawberry",
    "recipe-edit": "/recipes/strawberry/edit",
    "history": "/history",
    "inspection": "/history/{number}",
    "step": "/history/{number}/step/1",
    "audit": "/history/audit",
    "alarms": "/alarms",
    "maintenance": "/maintenance",
    "maintenance-hand": "/maintenance/hand",
    "maintenance-image": "/maintenance/image",
    "maintenance-sensor": "/maintenance/sensor",
    "maintenance-registers": "/maintenance/registers",
    "people": "/people",
}
CHROMIUM = shutil.which("chromium") or "/usr/bin/chromium"


class Load(NamedTuple):
    """A first load of the page Run, with nothing kept from before."""

    transferred_bytes: int
    requests: int
    shown_s: float


class Demo(NamedTuple):
    """The running demonstration."""

    site: Configuration
    process: subprocess.Popen[bytes]
    log: Path

    def part(self, name: str) -> psutil.Process:
        """One of its processes."""
        for child in psutil.Process(self.process.pid).children(recursive=True):
            if f"-m station {name}" in " ".join(child.cmdline()):
                return child
        raise SystemExit(f"the demonstration has no process {name}")

    def fruit(self) -> int:
        """How many there were."""
        return sum(line[:1].isdigit() for line in self.log.read_text(encoding="utf-8").splitlines())


@contextlib.contextmanager
def demo() -> Iterator[Demo]:
    """A demonstration on addresses of its own, once it has inspected some fruit."""
    modbus, metrics, hmi, camera, console = (free_port() for _ in range(5))
    with tempfile.TemporaryDirectory() as folder:
        file, log = Path(folder) / "station.yaml", Path(folder) / "demo.log"
        values = {
            "modbus": {"port": modbus},
            "metrics": {"port": metrics},
            "hmi": {"port": hmi, "refresh_s": REFRESH_S},
            "arm": {"host": HOST, "stale_after_s": 1.0},
            "gripper": {"urcap": {"host": HOST}, "modbus_rtu": {"host": HOST}, "answer_timeout_s": 2.0},
            "camera": {"oldest_s": 2.0, "twin": {"port": camera}},
            "service": {"patience": 5.0},
        }
        file.write_text(json.dumps(values), encoding="utf-8")
        environment = {
            **os.environ, "STATION_HOME": folder, "STATION_CONFIG": str(file), "OMP_NUM_THREADS": "1", "COLUMNS": "200",
        }  # fmt: skip
        command = [sys.executable, "-m", "station", "demo", "--console", str(console), "--speed", "12"]
        with log.open("wb") as output:
            process = subprocess.Popen(command, stdout=output, stderr=output, env=environment)
        running = Demo(load_configuration(file, {"STATION_HOME": folder}), process, log)
        try:
            until(lambda: running.fruit() >= FRUIT_FIRST or process.poll() is not None)
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


def first_load(browser: Browser, address: str) -> Load:
    """The page Run in a browser that has never seen it."""
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    page = context.new_page()
    sizes: list[float] = []
    page.context.new_cdp_session(page).send("Network.enable")
    watching = page.context.new_cdp_session(page)
    watching.send("Network.enable")
    watching.on("Network.loadingFinished", lambda told: sizes.append(told["encodedDataLength"]))
    began_s = time.monotonic()
    page.goto(address)
    picture = page.locator("img.fruit-picture")
    until(lambda: picture.count() and picture.evaluate("picture => picture.naturalWidth"))
    shown_s = time.monotonic() - began_s
    page.wait_for_timeout(500)
    context.close()
    return Load(round(sum(sizes)), len(sizes), shown_s)


def shares(parts: dict[str, psutil.Process], seconds: float) -> dict[str, float]:
    """How much of one core each process takes, %."""
    before = {name: sum(part.cpu_times()[:2]) for name, part in parts.items()}
    time.sleep(seconds)
    return {name: 100 * (sum(part.cpu_times()[:2]) - before[name]) / seconds for name, part in parts.items()}


def compare(running: Demo, browser: Browser, seconds: float) -> list[tuple[dict[str, float], Figures]]:
    """Processor and latency with nobody looking and with three browsers, in turn; each figure's median."""
    parts = {name: running.part(name) for name in ("hmi", "service")}
    address, port = address_of(running.site.hmi), running.site.modbus.port
    found: list[list[tuple[dict[str, float], Figures]]] = [[], []]
    with tempfile.TemporaryDirectory() as folder:
        load = built("load", Path(folder))
        for _ in range(ROUNDS):
            for looking in (0, 1):
                contexts = [browser.new_context() for _ in range(BROWSERS * looking)]
                for context in contexts:
                    context.new_page().goto(address)
                time.sleep(1.0)
                share = shares(parts, seconds)
                found[looking].append((share, measured(load, port, 1, SCAN_US, seconds)))
                for context in contexts:
                    context.close()
    return [
        (
            {name: sorted(share[name] for share, _ in runs)[ROUNDS // 2] for name in parts},
            middle([figures for _, figures in runs]),
        )
        for runs in found
    ]


def written(load: Load, alone: tuple[dict[str, float], Figures], looked_at: tuple[dict[str, float], Figures]) -> str:
    """The document."""
    cores = os.cpu_count() or 1
    more = sum(looked_at[0][name] - alone[0][name] for name in alone[0]) / cores
    latencies = [
        f"| PLC's latency at a 10 ms scan, {name}, µs | {getattr(alone[1], key):,.0f} "
        f"| {getattr(looked_at[1], key):,.0f} |"
        for name, key in (("p50", "p50_us"), ("p99", "p99_us"), ("worst", "worst_us"))
    ]
    told = (
        "Written by `./run bench hmi`: a demonstration with fruit after fruit, three pages Run open in a browser and "
        f"told what is new {1 / REFRESH_S:.0f} times a second, beside the same with nobody looking."
    )
    first = (
        f"First load of the page Run: {load.transferred_bytes / 1000:.0f} kB in {load.requests} requests, its picture "
        f"shown after {load.shown_s:.1f} s."
    )
    under = (
        f"Medians of {ROUNDS} rounds, in turn; FastAPI {version('fastapi')}, uvicorn {version('uvicorn')}, Python "
        f"{sys.version.split()[0]}, {cores} cores that twin, station, line, browsers and other work share."
    )
    lines = [
        "# What the operators' pages cost",
        "",
        told,
        "",
        "| | nobody looks | three browsers |",
        "|---|---|---|",
        f"| the pages' process, % of a core | {alone[0]['hmi']:.1f} | {looked_at[0]['hmi']:.1f} |",
        f"| the station's process, % of a core | {alone[0]['service']:.1f} | {looked_at[0]['service']:.1f} |",
        f"| what looking costs, of both, % of {cores} cores | | {more:.1f} |",
        *latencies,
        "",
        first,
        "",
        under,
        "",
    ]
    return "\n".join(lines)


def draw(running: Demo, browser: Browser) -> None:
    """Every page as a picture, at the panel's size and a phone's."""
    address = address_of(running.site.hmi)
    for size, (width, height) in SIZES.items():
        page = browser.new_context(viewport={"width": width, "height": height}).new_page()
        page.goto(f"{address}/people")
        if page.locator("form[action='/people/begin']").count():
            keep(page, "first-start")
            page.fill("#pin", PIN)
            page.fill("#again", PIN)
            with page.expect_navigation():
                page.locator("form[action='/people/begin'] .main").click()
            with page.expect_navigation():
                page.locator(".who form button").click()
            page.goto(f"{address}/people")
        keep(page, f"log-in{size}")
        page.locator("input[name=name]").first.check(force=True)
        page.fill("#pin", PIN)
        with page.expect_navigation():
            page.locator(".log-in .main").click()
        page.goto(address + "/")
        settled(page)
        tiles = page.locator(".tile-fail").all() or page.locator(".tile").all()
        number = next((tile.get_attribute("href") or "" for tile in tiles), "").rpartition("/")[2]
        for name, path in PAGES.items():
            page.goto(address + path.format(number=number))
            settled(page)
            keep(page, f"{name}{size}")
        page.goto(f"{address}/alarms")
        if page.locator(".alarm h2 a").count():
            page.locator(".alarm h2 a").first.click()
            keep(page, f"alarm{size}")
        page.context.close()
    for size, (width, height) in SIZES.items():  # the last, as the station raises an alarm of it
        page = browser.new_context(viewport={"width": width, "height": height}).new_page()
        page.goto(address)
        settled(page)
        running.part("hmi").suspend()
        page.locator("body.stale").wait_for()
        page.wait_for_timeout(2500)
        keep(page, f"stale{size}")
        running.part("hmi").resume()
        page.locator("body:not(.stale)").wait_for()
        page.context.close()


def keep(page: Page, name: str) -> None:
    """A picture of what is seen without scrolling, in few colours: the pages are grey."""
    drawn = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    drawn.quantize(64, dither=Image.Dither.NONE).save(PICTURES / f"hmi-{name}.png", optimize=True)


def settled(page: Page) -> None:
    """Until the pictures are there."""
    page.wait_for_load_state("load")
    page.wait_for_timeout(1200)


def main(arguments: list[str]) -> int:
    """Measure or draw."""
    seconds = float(next((each for each in arguments if each[0].isdigit()), "10"))
    with demo() as running, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        if "--pictures" in arguments:
            draw(running, browser)
        else:
            load = first_load(browser, address_of(running.site.hmi))
            text = written(load, *compare(running, browser, seconds))
            print(text)
            DOCUMENT.write_text(text, encoding="utf-8")
        browser.close()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
