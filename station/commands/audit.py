"""`station audit`: show and verify the audit trail."""

from pathlib import Path

import click

from station.errors import BadInputError
from station.records.audit_check import check_audit
from station.records.audit_head import Head, read_head
from station.records.audit_report import format_rows, read_audit
from station.records.database import reading, records_folder
from station.settings.configuration import load_configuration

_config = click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The configuration that names the home folder. [default: STATION_CONFIG, or station.yaml in STATION_HOME]",
)


@click.group()
def audit() -> None:
    """Show who changed or commanded what, and verify that the trail is complete."""


@audit.command()
@click.option("--last", metavar="N", default=20, show_default=True, type=click.IntRange(1, 100_000), help="How many.")
@click.option("--action", default="", metavar="NAME", help="Only this action, or all that begin so: recipe, alarm, …")
@click.option("--subject", default="", metavar="TEXT", help="Only rows with this text in their subject.")
@_config
def show(last: int, action: str, subject: str, config: Path | None) -> None:
    """Show the last rows, oldest first: action, object, person, time, reason, and the value before."""
    with reading(records_folder(load_configuration(config).home)) as connection:
        click.echo(format_rows(read_audit(connection, last, action, subject)))


@audit.command()
@click.option(
    "--anchor", "anchors", multiple=True, metavar="ROW:HASH", help="A row known from elsewhere, as from a backup."
)
@click.option(
    "--since", default=0, metavar="ROW", type=click.IntRange(0), help="Leave out rows before it: a known break."
)
@_config
@click.pass_context
def verify(context: click.Context, anchors: tuple[str, ...], since: int, config: Path | None) -> None:
    """Check that no row was changed, removed or inserted; exit code 1 if one was.

    Rows cut off at the end are found by the head that is stored beside the database, and by any ROW:HASH that this
    command printed before and a person stored elsewhere.
    """
    folder, known = records_folder(load_configuration(config).home), [_anchor(text) for text in anchors]
    with reading(folder) as connection:
        found = check_audit(connection, read_head(folder), known, since)
    for text in found.restored:
        click.echo(f"note {text}", err=True)
    for text in found.broken:
        click.echo(f"BROKEN {text}", err=True)
    if found.broken:
        context.exit(1)
    head = "" if found.head is None else f", the last one is {found.head.seq}:{found.head.hash}"
    click.echo(f"OK {found.rows} rows{head}")


def _anchor(text: str) -> Head:
    number, _, digest = text.partition(":")
    if not number.isascii() or not number.isdigit() or len(digest) != 64:
        raise BadInputError(f"--anchor: expected ROW:HASH as `station audit verify` prints it, got {text!r:.100}")
    return Head(int(number), digest.lower())
