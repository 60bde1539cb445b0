"""`station service`: the station's own process."""

import asyncio
from pathlib import Path

import click

from station.commands.signals import on_end_signals
from station.config_option import config_option
from station.logs import configure_logging
from station.memory import keep_freed_memory
from station.runtime.station import Station
from station.settings.configuration import Configuration
from station.settings.last_good import load_or_last_good


@click.command("service")
@config_option
@click.option(
    "--log",
    "style",
    type=click.Choice(["auto", "json", "human"]),
    default="auto",
    show_default=True,
    help="Style of the log lines.",
)
def service(config: Path | None, style: str) -> None:
    """Inspect fruit at the PLC's triggers, until SIGTERM or Ctrl-C. The arm and the gripper move.

    At SIGTERM the running inspection ends with its outcome, and the jaws open; then the exit code is 0.
    """
    configure_logging("station", style)  # pyrefly: ignore[bad-argument-type] (click has checked it)
    configuration, broken = load_or_last_good(config)
    asyncio.run(_run(configuration, broken))


async def _run(configuration: Configuration, broken: str) -> None:
    keep_freed_memory()
    station = Station(configuration, broken)
    on_end_signals(station.stop)
    await station.run(lambda port: _announce(configuration, port))


def _announce(configuration: Configuration, port: int) -> None:
    click.echo(f"metrics  http://{configuration.metrics.host}:{port}/metrics, /readyz, /livez, /version beside it")
    click.echo("running; SIGTERM or Ctrl-C ends it")
