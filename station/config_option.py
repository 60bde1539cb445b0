"""Option `--config` of every command that reads the configuration."""

from pathlib import Path

import click

config_option = click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The station.yaml to use. [default: STATION_CONFIG, or station.yaml in STATION_HOME]",
)
