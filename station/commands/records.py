"""`station records`: ask what happened."""

from pathlib import Path

import click

from station.records.database import reading, records_folder
from station.records.opening import set_mark
from station.records.reading import read_inspection, read_last
from station.records.report import described, listed
from station.settings.configuration import load_configuration

_config = click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The configuration that names the home folder. [default: STATION_CONFIG, or station.yaml in STATION_HOME]",
)


@click.group()
def records() -> None:
    """Ask what was inspected, and why it ended as it did."""


@records.command()
@click.argument("sequence", type=click.IntRange(1, 2**32 - 1))
@_config
def show(sequence: int, config: Path | None) -> None:
    """Show all that is known of the inspection with the number SEQUENCE: why it ended so, its curve, its images."""
    folder = _folder(config)
    with reading(folder) as connection:
        click.echo(described(read_inspection(connection, sequence, folder)))


@records.command("list")
@click.option("--last", metavar="N", default=20, show_default=True, type=click.IntRange(1, 100_000), help="How many.")
@_config
def list_last(last: int, config: Path | None) -> None:
    """List the last inspections, newest first."""
    with reading(_folder(config)) as connection:
        click.echo(listed(read_last(connection, last)))


@records.command("continue-after")
@click.argument("number", type=click.IntRange(0, 2**32 - 2))
@_config
def continue_after(number: int, config: Path | None) -> None:
    """Number the next inspection NUMBER + 1, where the station lost count; never lower than it knows itself."""
    set_mark(_folder(config), number)
    click.echo(f"the next inspection is number {number + 1}")


def _folder(config: Path | None) -> Path:
    """The records' folder."""
    return records_folder(load_configuration(config).home)
