"""Configuration of the commands that have to work while the station's file is broken."""

from pathlib import Path

import click

from station.settings.configuration import Configuration
from station.settings.last_good import read_or_last_good


def site_or_last_good(config: Path | None) -> Configuration:
    """Return the configuration by which the station runs: while its file is broken the last good one, with a note.

    Raises:
        SettingsError: it is broken, and there is no last good one.
    """
    site, broken = read_or_last_good(config)
    if broken:
        click.echo(f"{broken}\nthe last good configuration is used", err=True)
    return site
