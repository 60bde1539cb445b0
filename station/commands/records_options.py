"""Options shared by commands of `station records`."""

import getpass
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from station.channel.line import Reason
from station.records.database import records_folder
from station.records.search import Query
from station.settings.configuration import load_configuration

config_option = click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The configuration that names the home folder. [default: STATION_CONFIG, or station.yaml in STATION_HOME]",
)


def folder_of(config: Path | None) -> Path:
    """Return the records' folder.

    Args:
        config: the file that the user named.
    """
    return records_folder(load_configuration(config).home)


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

    gathered.__name__, gathered.__doc__ = command.__name__, command.__doc__
    gathered.__click_params__ = getattr(command, "__click_params__", [])  # type: ignore[attr-defined] (click's own)
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
    decorated: Callable[..., Any] = gathered
    for option in reversed(options):
        decorated = option(decorated)
    return decorated


def by_option(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the option of the person."""
    return click.option(
        "--by", metavar="WHO", default=getpass.getuser, help="Who does it, for the audit trail. [default: your login]"
    )(command)
