"""NiceGUI's page as a process beside the station: its packages, its start, and three browsers that show it."""

import contextlib
import hashlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
from monitoring.ports import free_port
from playwright.sync_api import Browser

LOCK, PROGRAM = Path(__file__).with_name("nicegui.lock"), Path(__file__).with_name("nicegui_page.py")
ROOT = Path(__file__).resolve().parents[2]
START_S = 60.0


def packages() -> Path:
    """The folder with NiceGUI and what it needs, installed by its lock where it is not.

    Not in the developers' environment: uvicorn takes another loop and parser as soon as NiceGUI's packages are there,
    and the tests' server would no longer be the one that is deployed.
    """
    name = f"nicegui-{hashlib.sha256(LOCK.read_bytes()).hexdigest()[:12]}"
    folder = Path(sys.prefix) / name
    if not folder.exists():
        with tempfile.TemporaryDirectory(dir=sys.prefix) as made:
            options = ("--quiet", "--disable-pip-version-check", "--require-hashes", "--no-deps")
            command = [sys.executable, "-m", "pip", "install", *options, "--target", f"{made}/{name}", "-r", str(LOCK)]
            subprocess.run(command, check=True)
            Path(made, name).rename(folder)
    return folder


@contextlib.contextmanager
def nicegui(configuration: Path) -> Iterator[tuple[psutil.Process, str]]:
    """NiceGUI's page of a running station: its process and its address."""
    port = free_port()
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join((str(packages()), str(ROOT))),
        "STATION_HOME": str(configuration.parent / "demo"),  # as the demonstration has it
    }
    # A session of its own: Ctrl-C on the terminal is the benchmark's, which ends it.
    process = subprocess.Popen(
        [sys.executable, str(PROGRAM), str(configuration), str(port)],
        env=environment, cwd=configuration.parent, stdout=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    served = psutil.Process(process.pid)
    try:
        deadline_s = time.monotonic() + START_S
        while not any(each.status == psutil.CONN_LISTEN for each in served.net_connections("inet")):
            if process.poll() is not None or time.monotonic() > deadline_s:
                raise SystemExit("NiceGUI's page did not start; its output is above")
            time.sleep(0.1)
        yield served, f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait(20)


@contextlib.contextmanager
def peer_browsers(browser: Browser, configuration: Path, count: int) -> Iterator[psutil.Process]:
    """Browsers with NiceGUI's page on the cores that the station has; gives the process that serves them."""
    with nicegui(configuration) as (served, address):
        contexts = [browser.new_context() for _ in range(count)]
        try:
            for context in contexts:
                page = context.new_page()
                page.goto(address)
                page.locator(".fruit-picture img").first.wait_for()
            yield served
        finally:
            for context in contexts:
                context.close()
