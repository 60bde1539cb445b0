"""`station records`: query the records."""

from pathlib import Path

import click

from station.commands.records_maintenance import backup, check, hold, holds, lot, release, restore
from station.commands.records_marks import mark, marks
from station.commands.records_options import folder_of, query_options
from station.commands.records_output import export, report
from station.config_option import config_option
from station.records.database import reading
from station.records.open import set_mark
from station.records.queries import Summary, read_inspection
from station.records.report import format_inspection, format_list
from station.records.search import LARGEST_PAGE, Query, find_page


@click.group()
def records() -> None:
    """Query inspections and their explanations; export them, and back them up."""


@records.command()
@click.argument("sequence", type=click.IntRange(1, 2**32 - 1))
@config_option
def show(sequence: int, config: Path | None) -> None:
    """Show everything stored of the inspection with the number SEQUENCE: explanation, curve, images."""
    folder = folder_of(config)
    with reading(folder) as connection:
        click.echo(format_inspection(read_inspection(connection, sequence, folder)))


@records.command("list")
@click.option("--last", metavar="N", default=20, show_default=True, type=click.IntRange(1, 100_000), help="How many.")
@click.option("--below", metavar="SEQUENCE", type=click.IntRange(1, 2**32), help="Only numbers below: the next page.")
@query_options
@config_option
def list_last(last: int, below: int | None, query: Query, config: Path | None) -> None:
    """List the last inspections, newest first; all conditions given have to be met."""
    found: list[Summary] = []
    with reading(folder_of(config)) as connection:
        while len(found) < last:
            page = find_page(connection, query, min(last - len(found), LARGEST_PAGE), below)
            found += page.rows
            below = page.below
            if below is None:
                break
    click.echo(format_list(found))
    if below is not None:
        click.echo(f"more: --below {below}", err=True)


@records.command("continue-after")
@click.argument("number", type=click.IntRange(0, 2**32 - 2))
@config_option
def continue_after(number: int, config: Path | None) -> None:
    """Number the next inspection NUMBER + 1, if the station lost count; never lower than its own records."""
    set_mark(folder_of(config), number)
    click.echo(f"the next inspection is number {number + 1}")


for command in (lot, hold, release, holds, mark, marks, export, report, backup, restore, check):
    records.add_command(command)
