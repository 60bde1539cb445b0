"""`station run`: the whole station, with supervised processes."""

import asyncio
import logging
from pathlib import Path

import click

from station.commands.signals import on_end_signals
from station.config_option import config_option
from station.settings.configuration import Configuration
from station.settings.hmi import address_of
from station.settings.last_good import load_or_last_good
from station.supervision.notify import notify
from station.supervision.programs import station_programs
from station.supervision.supervisor import Supervisor


@click.command("run")
@config_option
def run(config: Path | None) -> None:
    """Run the station until Ctrl-C: the service, the PLC interface and the pages, each a process of its own.

    A process that dies or hangs is restarted, at most 5 times within 60 s. On SIGTERM a running inspection ends, the
    jaws open, and all processes end.
    """
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s")
    site, _ = load_or_last_good(config)
    asyncio.run(_supervise(site, config))


async def _supervise(site: Configuration, config: Path | None) -> None:
    ended = asyncio.Event()
    on_end_signals(ended.set)

    def announce() -> None:
        click.echo(addresses(site))
        click.echo("running; Ctrl-C ends it")
        notify("READY=1")

    outbox = site.outbox.postgresql.enabled or site.outbox.mqtt.enabled
    programs = station_programs(config, outbox=outbox, clean_up_s=site.service.clean_up_deadline_s)
    await Supervisor(programs).run(announce, ended)


def addresses(site: Configuration) -> str:
    """Return the station's addresses, one line each."""
    return (
        f"HMI         {address_of(site.hmi)}\n"
        f"Modbus TCP  {site.modbus.host}:{site.modbus.port}, unit {site.modbus.unit}\n"
        f"metrics     http://{site.metrics.host}:{site.metrics.port}/metrics, health at /livez, /readyz, /version"
    )
