"""`station audit`: show and verify the audit trail."""

from pathlib import Path

import click

from station.commands.records_options import folder_of, proof_options
from station.config_option import config_option
from station.errors import BadInputError
from station.records.audit_check import Proof, check_trail
from station.records.audit_report import format_rows, read_audit
from station.records.database import reading
from station.records.signing import PUBLIC_NAME


@click.group()
def audit() -> None:
    """Show who changed or commanded what, and verify that the trail is complete."""


@audit.command()
@click.option("--last", metavar="N", default=20, show_default=True, type=click.IntRange(1, 100_000), help="How many.")
@click.option("--action", default="", metavar="NAME", help="Only this action, or all that begin so: recipe, alarm, …")
@click.option("--subject", default="", metavar="TEXT", help="Only rows with this text in their subject.")
@config_option
def show(last: int, action: str, subject: str, config: Path | None) -> None:
    """Show the last rows, oldest first: action, object, person, time, reason, and the value before."""
    with reading(folder_of(config)) as connection:
        click.echo(format_rows(read_audit(connection, last, action, subject)))


@audit.command()
@proof_options
@config_option
@click.pass_context
def verify(context: click.Context, proof: Proof, config: Path | None) -> None:
    """Check that no row was changed, removed or inserted; exit code 1 if one was.

    Rows cut off at the end are found by the signed head that is stored beside the database, and by any
    ROW:HASH:SIGNATURE that this command printed before and a person stored elsewhere.
    """
    found = check_trail(folder_of(config), proof)
    for text in found.notes:
        click.echo(f"note {text}", err=True)
    for text in found.broken:
        click.echo(f"BROKEN {text}", err=True)
    if found.broken:
        context.exit(1)
    click.echo(f"OK {found.rows} rows" + ("" if found.head is None else f", the last one is {found.head}"))


@audit.command("public-key")
@config_option
def public_key(config: Path | None) -> None:
    """Print the public part of the station's signing key: store it elsewhere, to check copies and backups by it."""
    path = folder_of(config) / PUBLIC_NAME
    if not path.exists():
        raise BadInputError(f"{path}: there is none; the station makes its key when it starts")
    click.echo(path.read_text(encoding="ascii", errors="replace"), nl=False)
