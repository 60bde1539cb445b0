"""`station records`: lots, holds, backups and checks."""

from pathlib import Path

import click
from sqlalchemy import Connection, exists, select

from station.by_option import by_option
from station.channel.panel_lots import LotView
from station.clock import formatted
from station.commands.records_options import folder_of, proof_options, public_keys_option
from station.commands.site import site_or_last_good
from station.config_option import config_option
from station.errors import StationError
from station.messages import records as messages
from station.records.audit import AuditEntry, append_audit
from station.records.audit_check import Proof
from station.records.backup import make_backup
from station.records.database import reading, records_folder
from station.records.errors import RecordsError
from station.records.holds import describe_stored, read_holds
from station.records.holds import hold as place_hold
from station.records.holds import release as release_hold
from station.records.images import MB
from station.records.integrity_check import check_records
from station.records.lots import end_lot, read_lots, start_lot
from station.records.restore import restore_backup
from station.records.schema import inspections
from station.records.short_transaction import short_transaction
from station.records.signing import public_keys_of
from station.records.texts import printable
from station.settings.configuration import load_configuration

_ROLE = "command line"
_thing = click.argument("thing", metavar="SEQUENCE|LOT")
_as_lot = click.option(
    "--lot/--inspection",
    "is_lot",
    default=None,
    help="What THING is. Needed where a lot's name is made of digits, as an inspection's number is.",
)


@click.group()
def lot() -> None:
    """Register lots: grower, start and end. The PLC gives only their names."""


@lot.command("start")
@click.argument("name")
@click.option("--grower", metavar="NAME", required=True, help="Whose fruit it is.")
@click.option("--correct", is_flag=True, help="Replace the grower registered before.")
@by_option
@config_option
def lot_start(name: str, grower: str, *, correct: bool, by: str, config: Path | None) -> None:
    """Register that the lot NAME starts, or runs again after its end. Repeating it changes nothing."""
    with short_transaction(folder_of(config)) as connection:
        started = start_lot(connection, name, grower, (by, _ROLE), correct=correct)
    click.echo(_lot_line(started))


@lot.command("end")
@click.argument("name")
@by_option
@config_option
def lot_end(name: str, by: str, config: Path | None) -> None:
    """Register that the lot NAME has ended. Repeating it changes nothing."""
    with short_transaction(folder_of(config)) as connection:
        ended = end_lot(connection, name, (by, _ROLE))
    click.echo(_lot_line(ended))


@lot.command("list")
@click.option("--grower", metavar="NAME", help="Of this grower.")
@click.option("--last", metavar="N", default=20, show_default=True, type=click.IntRange(1, 100_000), help="How many.")
@config_option
def lot_list(grower: str | None, last: int, config: Path | None) -> None:
    """List the registered lots, newest first."""
    with reading(folder_of(config)) as connection:
        for row in read_lots(connection, last, grower):
            click.echo(_lot_line(row))


@click.command()
@_thing
@_as_lot
@click.option("--reason", required=True, help="Why, for whoever asks later.")
@by_option
@config_option
def hold(thing: str, *, is_lot: bool | None, reason: str, by: str, config: Path | None) -> None:
    """Retain the images of an inspection, or all images of a lot: the quota does not remove them."""
    with short_transaction(folder_of(config)) as connection:
        before = read_holds(connection)
        meant = _number_or_lot(connection, thing, is_lot=is_lot)
        held = place_hold(connection, meant, reason, by)
        if held not in before:
            append_audit(connection, AuditEntry(by, _ROLE, "images.held", held.description, reason))
    with reading(folder_of(config)) as connection:
        stored = describe_stored(connection, meant)
    since = f"since {formatted(held.placed_utc_ms)}, by {held.by}: {held.reason}"
    click.echo(printable(f"the images of {held.description} are retained {since}"))
    click.echo(f"stored of it: {stored}")


@click.command()
@_thing
@_as_lot
@click.option("--reason", required=True, help="Why, for whoever asks later.")
@by_option
@config_option
def release(thing: str, *, is_lot: bool | None, reason: str, by: str, config: Path | None) -> None:
    """Release retained images: the quota may remove them."""
    with short_transaction(folder_of(config)) as connection:
        released = release_hold(connection, _number_or_lot(connection, thing, is_lot=is_lot), reason, by)
        entry = AuditEntry(by, _ROLE, "images.released", released.description, reason, {"held for": released.reason})
        append_audit(connection, entry)
    click.echo(printable(f"the images of {released.description} are no longer retained"))


@click.command()
@config_option
def holds(config: Path | None) -> None:
    """List the inspections and lots whose images are retained, oldest first."""
    with reading(folder_of(config)) as connection:
        for held in read_holds(connection):
            click.echo(printable(f"{formatted(held.placed_utc_ms)}  {held.description}  by {held.by}: {held.reason}"))


@click.command()
@click.argument("directory", metavar="DIR", type=click.Path(path_type=Path))
@config_option
def backup(directory: Path, config: Path | None) -> None:
    """Copy the database and all images to the new folder DIR, also while the station runs, and verify the copy.

    DIR appears when it is complete and on the disk; it must not exist before. It takes nothing of the space below which
    the station removes images.
    """
    site = site_or_last_good(config)
    reserve_bytes = 2 * site.records.free_reserve_mb * MB
    made = make_backup(records_folder(site.home), directory, reserve_bytes)
    click.echo(f"{directory}: {made.inspections} inspections, {made.images} images, {made.size_bytes} bytes, verified")
    if made.audit_head:
        click.echo(f"the audit trail's last row in it: {made.audit_head}")
    for note in made.notes:
        click.echo(f"note: {note}", err=True)


@click.command()
@click.argument("directory", metavar="DIR", type=click.Path(path_type=Path))
@by_option
@public_keys_option
@click.option(
    "--unverified",
    is_flag=True,
    help="Restore a backup without checking who made it: what was changed in it is then not found.",
)
@config_option
def restore(directory: Path, by: str, public_keys: tuple[Path, ...], *, unverified: bool, config: Path | None) -> None:
    """Replace the records by the backup in DIR, while no station runs. The present records are moved aside.

    The backup has to be signed by this station, or by the one whose public key is given. The space below which the
    station accepts no trigger has to stay free.
    """
    site = load_configuration(config)
    folder = records_folder(site.home)
    keys = None if unverified else public_keys_of(folder, public_keys)
    restored = restore_backup(folder, directory, by, keys, site.records.free_reserve_mb * MB)
    click.echo(f"restored {restored.inspections} inspections and {restored.images} images from {directory}")
    if restored.aside is not None:
        click.echo(f"what was there is in {restored.aside}")


@click.command()
@proof_options
@config_option
def check(proof: Proof, config: Path | None) -> None:
    """Check the whole database, and every image against its name, also while the station runs; exit code 1 for faults.

    Finds what was changed, removed or added by others than the station: in the database's schema and triggers, in the
    audit trail, and in the inspections and images that it seals. It changes nothing. The station's next start repairs
    files without a row and rows without a file.
    """
    found = check_records(folder_of(config), proof)
    for fault in found.faults:
        click.echo(f"fault: {fault}")
    for note in found.notes:
        click.echo(f"note: {note}")
    click.echo(f"{found.inspections} inspections and {found.images} images checked")
    if found.faults:
        raise StationError("the records are not sound: see the faults above; a backup is put back by `records restore`")


def _number_or_lot(connection: Connection, thing: str, *, is_lot: bool | None) -> int | str:
    """Return an inspection's number or a lot's name.

    Raises:
        RecordsError: it may be both.
    """
    if is_lot or not (thing.isascii() and thing.isdigit()):
        return thing
    if is_lot is None and connection.scalar(select(exists().where(inspections.c.lot == thing))):
        raise RecordsError(messages.NUMBER_AND_LOT(lot=thing), messages.SAY_WHICH())
    return int(thing)


def _lot_line(row: LotView) -> str:
    ended = "runs" if row.ended_utc_ms is None else f"ended {formatted(row.ended_utc_ms)}"
    return printable(f"{row.name}: {row.grower}, began {formatted(row.began_utc_ms)}, {ended}")
