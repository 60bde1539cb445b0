"""`station records mark`: a person's mark of fruit as good or bad, for proposed thresholds."""

from pathlib import Path

import click

from station.by_option import by_option
from station.clock import formatted
from station.commands.records_options import folder_of
from station.config_option import config_option
from station.records.audit import AuditEntry, append_audit
from station.records.database import reading
from station.records.marks import Mark, place_mark, read_marked
from station.records.short_transaction import short_transaction
from station.records.texts import printable

_MARKS: dict[str, Mark | None] = {"good": "good", "bad": "bad", "none": None}


@click.command()
@click.argument("sequences", metavar="SEQUENCE...", nargs=-1, required=True, type=click.IntRange(1))
@click.argument("word", metavar="good|bad|none", type=click.Choice(list(_MARKS)))
@by_option
@config_option
def mark(sequences: tuple[int, ...], word: str, by: str, config: Path | None) -> None:
    """Mark fruit as good or bad, independent of the station's outcome; `none` removes a mark.

    `station thresholds` proposes limits from the marks. All of the fruit are marked, or none.
    """
    wanted, changed = _MARKS[word], 0
    with short_transaction(folder_of(config)) as connection:
        for sequence in sequences:
            before = place_mark(connection, sequence, wanted, by)
            if (was := None if before is None else before.mark) != wanted:
                changed += 1
                entry = AuditEntry(by, "command line", "fruit.marked", f"inspection {sequence}", old=was, new=wanted)
                append_audit(connection, entry)
    click.echo(f"{changed} of {len(sequences)} fruit newly marked {word}")


@click.command()
@config_option
def marks(config: Path | None) -> None:
    """List the fruit that people have marked, with person and time."""
    with reading(folder_of(config)) as connection:
        for each in read_marked(connection):
            click.echo(printable(f"{each.sequence}  {each.mark}  by {each.by}, {formatted(each.marked_utc_ms)}"))
