"""`station support`: write a support bundle."""

from datetime import UTC, datetime
from pathlib import Path

import click

from station.errors import StationError
from station.settings.configuration import load_configuration
from station.support.bundle import bundle


@click.command()
@click.option("--out", type=click.Path(path_type=Path), help="ZIP file to write. [default: support-TIME.zip]")
def support(out: Path | None) -> None:
    """Write a support bundle: versions, configuration, recipes, logs, alarms and recent inspections, nothing secret.

    It works with the station running, stopped or broken. Passwords, PINs, tokens, keys, people, the audit trail and
    images are not in it.
    """
    target = out or Path(f"support-{datetime.now(UTC):%Y%m%dT%H%M%SZ}.zip")
    if target.exists():
        raise click.UsageError(f"{target}: is there already; name a new file with --out")
    try:
        parts = bundle(load_configuration(), target)
    except OSError as error:
        raise StationError(f"{target}: cannot be written: {error.strerror}; name another file with --out") from error
    click.echo(f"{target}: {', '.join(parts)}")
