"""Options shared by commands of `station records`."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from station.channel.line import Reason
from station.errors import BadInputError
from station.records.audit_check import Proof
from station.records.audit_head import Head
from station.records.database import records_folder
from station.records.search import Query
from station.records.signing import read_public_key
from station.settings.configuration import load_configuration


def folder_of(config: Path | None) -> Path:
    """Return the records' folder of the configuration's file that the user named."""
    return records_folder(load_configuration(config).home)


public_keys_option = click.option(
    "--public-key",
    "public_keys",
    multiple=True,
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The station's public key, stored elsewhere, or one that it had before. [default: that of these records]",
)


class Moment(click.ParamType):
    """Date, or date and time, ISO 8601; UTC without an offset. Converted to ms since 1970."""

    name = "time"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Read the text."""
        if isinstance(value, int):
            return value
        try:
            moment = datetime.fromisoformat(value)
        except ValueError:
            self.fail(f"{value!r} is no time; write 2026-06-30, 2026-06-30T14:05 or 2026-06-30T14:05+02:00", param, ctx)
        return int((moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp() * 1000)


def query_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the conditions of a search, passed as `query`."""

    def gathered(
        *,
        lot: str | None,
        grower: str | None,
        begun_from: int | None,
        begun_to: int | None,
        outcome: Any,
        reason: str | None,
        fruit: str | None,
        **others: Any,
    ) -> Any:
        why = None if reason is None else Reason(reason)
        return command(query=Query(lot, grower, begun_from, begun_to, outcome, why, fruit), **others)

    options = (
        click.option("--lot", metavar="NAME", help="Of this lot."),
        click.option("--grower", metavar="NAME", help="Of this grower's lots; see `station records lot`."),
        click.option(
            "--from", "begun_from", metavar="TIME", type=Moment(), help="Begun then or later; UTC: 2026-06-30T14:05."
        ),
        click.option("--to", "begun_to", metavar="TIME", type=Moment(), help="Begun before then."),
        click.option("--outcome", type=click.Choice(["PASS", "FAIL", "NO_RESULT"]), help="Ended so."),
        click.option(
            "--reason",
            type=click.Choice([str(reason) for reason in Reason]),
            help="With this reason among its reasons.",
        ),
        click.option("--fruit", metavar="NAME", help="Inspected by this recipe, whatever its revision."),
    )
    return _with_options(gathered, command, options)


def _with_options(
    gathered: Callable[..., Any], command: Callable[..., Any], options: Sequence[Callable[..., Any]]
) -> Callable[..., Any]:
    """Name and document an option reader as its command, and put these options before the command's own."""
    gathered.__name__, gathered.__doc__ = command.__name__, command.__doc__
    gathered.__click_params__ = getattr(command, "__click_params__", [])  # pyrefly: ignore[missing-attribute] (click's own)
    for option in reversed(options):
        gathered = option(gathered)
    return gathered


def proof_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add what a person knows from elsewhere of the audit trail, passed as `proof`."""

    def gathered(*, anchors: tuple[str, ...], public_keys: tuple[Path, ...], since: int, **others: Any) -> Any:
        heads = tuple(_anchor(text) for text in anchors)
        if public_keys and not all(head.signature for head in heads):
            raise BadInputError("--anchor: with --public-key an anchor needs its signature: ROW:HASH:SIGNATURE")
        return command(proof=Proof(heads, tuple(map(read_public_key, public_keys)), since), **others)

    options = (
        click.option(
            "--anchor",
            "anchors",
            multiple=True,
            metavar="ROW:HASH:SIGNATURE",
            help="A row known from elsewhere, as from a backup or from this command.",
        ),
        public_keys_option,
        click.option(
            "--since", default=0, metavar="ROW", type=click.IntRange(0), help="Leave out rows before it: a known break."
        ),
    )
    return _with_options(gathered, command, options)


def _anchor(text: str) -> Head:
    number, _, rest = text.partition(":")
    digest, _, signature = rest.partition(":")
    if not number.isascii() or not number.isdigit() or len(digest) != 64:
        raise BadInputError(
            f"--anchor: expected ROW:HASH:SIGNATURE as `station audit verify` prints it, got {text!r:.100}"
        )
    return Head(int(number), digest.lower(), signature)
