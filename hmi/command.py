"""`station hmi`: the operators' pages."""

import asyncio
import logging
import sys
import time
from pathlib import Path

import click

from hmi.process import serve
from station.settings.configuration import load_configuration


@click.command("hmi")
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="The station.yaml to use.")
def hmi(config: Path | None) -> None:
    """Serve the operators' pages until SIGTERM or Ctrl-C; `station run` starts this by itself.

    It shows the station through its channel; while the station is away the pages say so and go on by themselves.
    """
    handler = logging.StreamHandler(sys.stderr)
    formatter = logging.Formatter("%(asctime)s.%(msecs)03dZ %(levelname)s %(name)s: %(message)s", "%Y-%m-%dT%H:%M:%S")
    formatter.converter = time.gmtime
    handler.setFormatter(formatter)
    logging.basicConfig(level=logging.INFO, handlers=[handler])
    asyncio.run(serve(load_configuration(config)))
