"""`station records`: exports and reports for other programs and people."""

from pathlib import Path

import click

from station.commands.records_options import folder_of, query_options
from station.config_option import config_option
from station.records.error_mapping import map_error
from station.records.export import SUFFIXES
from station.records.export import export as write_export
from station.records.lot_report import SUFFIX, html_report
from station.records.lot_summary import summarise
from station.records.search import Query
from station.settings.configuration import load_configuration


@click.command()
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@query_options
@config_option
def export(file: Path, query: Query, config: Path | None) -> None:
    """Write inspections to FILE, one row each: .csv or .parquet by its suffix; all, or those of the conditions."""
    if file.suffix not in SUFFIXES:
        raise click.UsageError(f"{file}: expected a file that ends in {' or '.join(SUFFIXES)}")
    click.echo(f"{file}: {write_export(folder_of(config), query, file)} inspections")


@click.command()
@click.argument("lot")
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False))
@config_option
def report(lot: str, file: Path, config: Path | None) -> None:
    """Write a report of the lot LOT to FILE.html, one file that needs no other; a browser prints it on A4 or as PDF."""
    if file.suffix != SUFFIX:
        raise click.UsageError(
            f"{file}: expected a file that ends in {SUFFIX}; for paper or a PDF, print that file from a browser"
        )
    summary = summarise(folder_of(config), lot)
    try:
        file.write_text(html_report(summary, load_configuration(config).outbox.station), encoding="utf-8")
    except OSError as error:
        raise map_error(error, str(file)) from error
    click.echo(f"{file}: {summary.total} inspections of lot {lot}")
