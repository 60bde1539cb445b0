"""`station support`: write a support bundle."""

import os
from datetime import UTC, datetime
from pathlib import Path

import click

from station.errors import StationError
from station.settings.configuration import Configuration, load_configuration
from station.settings.environment import variable
from station.settings.last_good import read_last_good
from station.settings.problems import SettingsError
from station.support.bundle import bundle


@click.command()
@click.option("--out", type=click.Path(path_type=Path), help="ZIP file to write. [default: support-TIME.zip]")
def support(out: Path | None) -> None:
    """Write a support bundle: versions, configuration, recipes, logs, alarms and recent inspections, nothing secret.

    It works with the station running, stopped or broken. Passwords, PINs, tokens, keys, the file of people, the
    audit trail and images are not in it. Logs and alarms name people: who logged in and from where, who ordered what.
    """
    target = out or Path(f"support-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.zip")
    try:
        if target.exists():
            raise click.UsageError(f"{target}: is there already; name a new file with --out")
        parts = bundle(*_configuration(), target)
    except OSError as error:
        raise StationError(f"{target}: cannot be written: {error.strerror}; name another file with --out") from error
    click.echo(f"{target}: {', '.join(parts)}")


def _configuration() -> tuple[Configuration, str]:
    """Return the configuration, or the last good one, or the defaults, and the error in its files; empty for none."""
    try:
        return load_configuration(), ""
    except SettingsError as error:
        home = Path(os.environ.get(variable(("home",)), Configuration().home)).absolute()
        return read_last_good(None) or Configuration(home=home), str(error)
