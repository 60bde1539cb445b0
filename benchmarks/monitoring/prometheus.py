"""Debian's Prometheus in a folder of one's own, with the shipped configuration and rules, and promtool."""

import json
import os
import shutil
import signal
import subprocess
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from .ports import free_port

SHIPPED = Path(__file__).resolve().parents[2] / "deploy" / "prometheus"
RULES = SHIPPED / "rules"
_LIMIT_S = 60.0


class Series(NamedTuple):
    """One answer: its labels, and (time, value) pairs."""

    labels: dict[str, str]
    points: list[tuple[float, float]]


class UnansweredError(Exception):
    """Prometheus refused a query, with its reason."""


def missing() -> str | None:
    """Return the first of `prometheus` and `promtool` that is not installed; None if both are."""
    return next((name for name in ("prometheus", "promtool") if shutil.which(name) is None), None)


def promtool(*arguments: object, given: str = "") -> str:
    """Run promtool.

    Args:
        arguments: its own.
        given: what it reads from its input.

    Raises:
        RuntimeError: it failed; with its output.
    """
    command = ["promtool", *map(str, arguments)]
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=False, timeout=600)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def write_configuration(folder: Path, interval: str, targets: dict[str, str]) -> Path:
    """The shipped configuration with a pace and stations of one's own, and no receiver of alerts.

    Args:
        folder: for the files.
        interval: of scrapes and rules.
        targets: addresses by the stations' names; without any, nothing is scraped and no rule evaluated.
    """
    configuration = yaml.safe_load((SHIPPED / "prometheus.yml").read_text())
    configuration["global"] = {"scrape_interval": interval, "scrape_timeout": interval, "evaluation_interval": interval}
    configuration["rule_files"] = [str(RULES / "*.yml")] if targets else []
    del configuration["alerting"]
    stations = [{"targets": [address], "labels": {"station": name}} for name, address in targets.items()]
    (folder / "stations.json").write_text(json.dumps(stations))
    configuration["scrape_configs"][0]["file_sd_configs"] = [{"files": [str(folder / "stations.json")]}]
    file = folder / "prometheus.yml"
    file.write_text(yaml.safe_dump(configuration))
    return file


class Prometheus:
    """A running server.

    Args:
        address: where it answers.
    """

    def __init__(self, address: str) -> None:
        self.address = address

    def now(self, expr: str, at_s: float | None = None) -> list[Series]:
        """Evaluate an expression at one time.

        Args:
            expr: PromQL.
            at_s: the time, seconds since 1970; None for now.

        Raises:
            UnansweredError: the expression is wrong.
        """
        found = self._query("query", query=expr, **({} if at_s is None else {"time": at_s}))
        if found["resultType"] == "scalar":
            return [Series({}, [_point(found["result"])])]
        return [Series(each["metric"], [_point(each["value"])]) for each in found["result"]]

    def over(self, expr: str, begin_s: float, end_s: float, step_s: float) -> list[Series]:
        """Evaluate an expression over a range of time.

        Args:
            expr: PromQL.
            begin_s: first time, seconds since 1970.
            end_s: last time.
            step_s: between two points.

        Raises:
            UnansweredError: the expression is wrong, or has too many points.
        """
        found = self._query("query_range", query=expr, start=begin_s, end=end_s, step=step_s)
        return [Series(each["metric"], [_point(pair) for pair in each["values"]]) for each in found["result"]]

    def names(self) -> set[str]:
        """Of all metrics and recorded series that it has of stations."""
        return {each["__name__"] for each in self._query("series", **{"match[]": '{station!=""}'})}

    def get(self, what: str) -> Any:
        """Another part of its interface, as `rules`.

        Args:
            what: below /api/v1/.
        """
        return self._query(what)

    def _query(self, what: str, **fields: object) -> Any:
        body = urllib.parse.urlencode(fields).encode() or None
        request = urllib.request.Request(f"{self.address}/api/v1/{what}", body)
        try:
            with urllib.request.urlopen(request, timeout=_LIMIT_S) as answer:
                return json.load(answer)["data"]
        except urllib.error.HTTPError as error:
            with error:
                raise UnansweredError(f"{fields.get('query')}: {error.read().decode()}") from error


@contextmanager
def running(folder: Path, configuration: Path, *options: str) -> Iterator[Prometheus]:
    """A server, gone afterwards; its data stays.

    Args:
        folder: its data is in `data`, its log in `prometheus.log`.
        configuration: see `write_configuration`.
        options: further ones of its command line.
    """
    port = free_port()
    command = [
        "prometheus", f"--config.file={configuration}", f"--storage.tsdb.path={folder / 'data'}",
        f"--web.listen-address=127.0.0.1:{port}", *options,
    ]  # fmt: skip
    with (folder / "prometheus.log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env={**os.environ, "GOMAXPROCS": "1"})
    server = Prometheus(f"http://127.0.0.1:{port}")
    try:
        until_s = time.monotonic() + _LIMIT_S
        while not _answers(server):
            if process.poll() is not None or time.monotonic() > until_s:
                raise RuntimeError(f"Prometheus does not run: {(folder / 'prometheus.log').read_text()}")
            time.sleep(0.05)
        yield server
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(_LIMIT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def shipped_alerts() -> dict[str, dict[str, Any]]:
    """The shipped alerts by their names."""
    found = {}
    for file in sorted(RULES.glob("*.yml")):
        for group in yaml.safe_load(file.read_text(encoding="utf-8"))["groups"]:
            found |= {rule["alert"]: rule for rule in group["rules"] if "alert" in rule}
    return found


def recordings() -> dict[str, str]:
    """The shipped recorded series: their expressions by their names."""
    groups = yaml.safe_load((RULES / "recording.yml").read_text(encoding="utf-8"))["groups"]
    return {rule["record"]: rule["expr"] for group in groups for rule in group["rules"]}


def _answers(server: Prometheus) -> bool:
    try:
        with urllib.request.urlopen(f"{server.address}/-/ready", timeout=5):
            return True
    except OSError:
        return False


def _point(pair: list[Any]) -> tuple[float, float]:
    return float(pair[0]), float(pair[1])
