"""Attacks on Modbus, pages, API and metrics of a whole station, and what clients and processes notice of them.

Run with `./run bench attack [--seconds N] [--small] [--only WORD]`: a demonstration with fruit after fruit in a network
namespace of its own; needs `unshare` and `ip`. Writes `docs/attacks.md`. Exits 1 where something does not hold.
"""

import argparse
import contextlib
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from http.client import HTTPException
from pathlib import Path
from typing import Any

import psutil
from attack import modbus, pages
from attack.bystanders import HOST, Browser
from attack.document import BACK_S, MOST_FILES_LEFT, MOST_GROWN_MB, Process, Row, markdown
from attack.target import Attack, Found, Target
from bench_hmi import demo, until
from monitoring.ports import free_port

from hmi.web.roles import Role
from station.settings.hmi import panel_endpoint

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "attacks.md"
BYSTANDERS = Path(__file__).resolve().parent / "attack" / "bystanders.py"
SECONDS, SMALL_S = 8.0, 2.0
APART = "ATTACK_APART"
NETWORK = "10.79.0.0/16"
SETUP = f'ip link set lo up && ip route add local {NETWORK} dev lo && exec "$@"'
ANYWHERE = "0.0.0.0"
MOST_FILES = 4096


def go_apart() -> None:
    """Become this program in a network namespace, where each address of the attack is this machine's."""
    if os.environ.pop(APART, ""):
        return
    unshare = shutil.which("unshare")
    if unshare is None or shutil.which("ip") is None:
        raise SystemExit("unshare and ip are needed; on Debian: apt-get install util-linux iproute2")
    command = [unshare, "--map-root-user", "--net", "sh", "-c", SETUP, "sh", sys.executable, *sys.argv]
    os.execve(unshare, command, {**os.environ, APART: "1"})


def certified(folder: Path) -> tuple[str, str]:
    """Make a certificate, signed by itself, and its key."""
    certificate, key = str(folder / "certificate.pem"), str(folder / "key.pem")
    made = f"openssl req -x509 -newkey rsa:2048 -nodes -days 2 -subj /CN=station -keyout {key} -out {certificate}"
    subprocess.run(made.split(), check=True, capture_output=True)
    return certificate, key


@contextlib.contextmanager
def over_tls(folder: Path, configuration: Path, certificate: str, key: str) -> Iterator[tuple[str, psutil.Process]]:
    """Serve the same pages by one more process over TLS."""
    port = free_port()
    variables = {
        "STATION_HMI_PORT": str(port),
        "STATION_HMI_TLS_ENABLED": "true",
        "STATION_HMI_TLS_CERTIFICATE": certificate,
        "STATION_HMI_TLS_KEY": key,
    }
    command = [sys.executable, "-m", "station", "hmi", "--config", str(configuration)]
    log = folder / "tls.log"
    with log.open("wb") as output:
        process = subprocess.Popen(command, env={**os.environ, **variables}, stdout=output, stderr=output)
    try:
        until(lambda: "the pages are served" in log.read_text() or process.poll() is not None)
        if process.poll() is not None:
            raise SystemExit(log.read_text(encoding="utf-8"))
        yield f"https://{HOST}:{port}", psutil.Process(process.pid)
    finally:
        process.terminate()
        process.wait(60)


def add_people(url: str) -> None:
    """Add a person of each role, at the station's own screen."""
    admin = Browser(url, "127.0.0.1")
    name, pin = pages.PINS[Role.ADMIN]
    answers = [admin.post("/people/begin", name=name, pin=pin, again=pin)]
    for role, (name, pin) in pages.PINS.items():
        if role is not Role.ADMIN:
            answers.append(admin.post("/people/put", name=name, role=role, pin=pin))
    if set(answers) != {303}:
        raise SystemExit(f"people cannot be added: {answers}")


@contextlib.contextmanager
def station(seconds: float) -> Iterator[tuple[Target, str]]:
    """Run the station, with people, an API token and pages over TLS; also gives the panel's endpoint."""
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        names = [HOST, "127.0.0.1", "localhost"]
        certificate, key = certified(folder)
        files = {"certificate": certificate, "key": key, "client_authority": certificate}
        served = {
            "host": ANYWHERE,
            "readers": ["127.0.0.0/8", NETWORK],
            "writers": ["127.0.0.0/8", NETWORK],
            "tls": {"enabled": True, "port": free_port(), **files},
        }
        running = stack.enter_context(
            demo(1, modbus=served, metrics={"host": ANYWHERE}, hmi={"host": ANYWHERE, "names": names})
        )
        site, configuration = running.site, running.log.with_name("station.yaml")
        home = site.home / "demo"  # where a demonstration keeps what it has
        os.environ["STATION_HOME"] = str(home)
        stack.callback(os.environ.pop, "STATION_HOME")
        add_people(f"http://127.0.0.1:{site.hmi.port}")
        command = [sys.executable, "-m", "station", "api-token", "add", "attack", "--role", "operator"]
        made = subprocess.run([*command, "--config", str(configuration)], capture_output=True, text=True, check=True)
        tls, tls_process = stack.enter_context(over_tls(folder, configuration, certificate, key))
        processes = {name: running.part(name) for name in ("plc run", "hmi", "service")}
        processes = {name.partition(" ")[0]: each for name, each in processes.items()} | {"tls": tls_process}
        url = f"http://{HOST}:{site.hmi.port}"
        target = Target(
            modbus=site.modbus.port,
            modbus_tls=site.modbus.tls.port,
            metrics=site.metrics.port,
            pages=url,
            tls=tls,
            home=home,
            token=made.stdout.split()[-1],
            processes=processes,
            seconds=seconds,
        )
        yield target, panel_endpoint(site.hmi, home)


class Bystander:
    """One process beside an attack."""

    def __init__(self, *arguments: object) -> None:
        command = [sys.executable, str(BYSTANDERS), *map(str, arguments)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def wait_started(self) -> None:
        """Wait until it has started."""
        if self._process.stdout is None or self._process.stdout.readline() != "begun\n":
            raise SystemExit("a client beside the attack did not begin")

    def end(self) -> dict[str, Any]:
        """End it; return its results."""
        return json.loads(self._process.communicate(timeout=60)[0])


class Sampled(threading.Thread):
    """A process's memory and descriptors over time."""

    def __init__(self, process: psutil.Process) -> None:
        super().__init__(name="sampling", daemon=True)
        self._process, self.over = process, threading.Event()
        self.before = self.most = self.now()

    def now(self) -> tuple[float, int]:
        """Return memory, MB, and descriptors."""
        return self._process.memory_info().rss / 1e6, self._process.num_fds()

    def run(self) -> None:
        """Sample until over."""
        with contextlib.suppress(psutil.Error):
            while not self.over.wait(0.1):
                memory, files = self.now()
                self.most = max(memory, self.most[0]), max(files, self.most[1])

    def result(self) -> Process:
        """Return the figures, once memory and descriptors are what they were, or time is up."""
        self.over.set()
        self.join()
        until_s, after = time.monotonic() + BACK_S, self.before
        most_mb, most_files = self.before[0] + MOST_GROWN_MB, self.before[1] + MOST_FILES_LEFT
        try:
            after = self.now()
            while (after[0] > most_mb or after[1] > most_files) and time.monotonic() < until_s:
                time.sleep(0.5)
                after = self.now()
        except psutil.Error:
            return Process(self.before[0], self.most[0], 0.0, self.before[1], self.most[1], 0, ended=True)
        return Process(self.before[0], self.most[0], after[0], self.before[1], self.most[1], after[1], ended=False)


def carried_out(attack: Attack, target: Target, endpoint: str) -> Row:
    """Carry an attack out, with its bystanders."""
    sampled = Sampled(target.processes[attack.on or "hmi"])
    name, pin = pages.PINS[Role.OPERATOR]
    client = Bystander("scan", target.modbus)
    panel = Bystander("panel", target.tls if attack.on == "tls" else target.pages, endpoint, name, pin)
    client.wait_started()
    panel.wait_started()
    sampled.start()
    try:
        found = attack.run(target)
    except (OSError, HTTPException) as error:
        found = Found(0, "", f"the attack itself ended: {error!r}")
    scanned, stopped = client.end(), panel.end()
    process = sampled.result()
    scans, stops = (scanned["took_ms"], scanned["errors"]), (stopped["stop_s"], stopped["failed"])
    row = Row(attack.on, attack.name, found, *scans, *stops, process)
    print(f"{attack.on} {attack.name}: {found.seen}: {'; '.join(row.wrong) or 'holds'}", flush=True)
    return row


def nothing(target: Target) -> Found:
    """No attack, for comparison."""
    time.sleep(target.seconds)
    return Found(0, "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Attack, and write after each row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of each attack")
    parser.add_argument("--small", action="store_true", help="short attacks, and no document")
    parser.add_argument("--only", default="", help="attacks with this word in their row alone, and no document")
    options = parser.parse_args(arguments)
    go_apart()
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(MOST_FILES, hard), hard))
    seconds = SMALL_S if options.small else options.seconds
    attacks = [Attack("", "no attack", nothing), *modbus.ATTACKS, *pages.ATTACKS]
    chosen = [each for each in attacks if options.only in f"{each.on} {each.name}"]
    before = os.getloadavg()[0]
    rows: list[Row] = []
    with station(seconds) as (target, endpoint):
        for attack in chosen:
            rows.append(carried_out(attack, target, endpoint))
            text = markdown(rows, seconds, (before, os.getloadavg()[0]))
            if not options.small and not options.only:
                DOCUMENT.write_text(text, encoding="utf-8")
    return any(row.wrong for row in rows)


if __name__ == "__main__":
    raise SystemExit(main())
