"""`station hmi`: the operators' pages."""

import asyncio
from pathlib import Path

import click

from hmi.web.process import serve
from station.config_option import config_option
from station.logs import configure_logging
from station.settings.configuration import configuration_file
from station.settings.last_good import load_or_last_good


@click.command("hmi")
@config_option
def hmi(config: Path | None) -> None:
    """Serve the operators' pages until SIGTERM or Ctrl-C; `station run` starts this by itself.

    It shows the station through its channel; while the station does not answer, the pages report that and recover by
    themselves.
    """
    configure_logging("hmi")
    site, broken = load_or_last_good(config)
    asyncio.run(serve(site, configuration_file(config), broken))
