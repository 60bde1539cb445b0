"""`station api-token`: the tokens of the systems that use the HTTP API."""

import re
from datetime import UTC, datetime
from pathlib import Path

import click

from hmi.api.tokens import NAME, ROLES, ApiTokens
from hmi.web.roles import Role
from hmi.web.user_store import FOLDER
from station.by_option import by_option
from station.config_option import config_option
from station.records.audit import AuditEntry, append_audit
from station.records.database import records_folder
from station.records.direct_transaction import direct_transaction
from station.settings.configuration import load_configuration

_ROLE = "command line"


@click.group("api-token")
def api_token() -> None:
    """Create and withdraw the tokens by which a plant's systems use the HTTP API."""


@api_token.command()
@click.argument("name")
@click.option(
    "--role",
    type=click.Choice([role.value for role in ROLES]),
    default=Role.VIEWER.value,
    show_default=True,
    help="A viewer's token reads; an operator's also begins and ends lots.",
)
@click.option(
    "--days", type=click.IntRange(1, 3650), metavar="N", help="Valid for so many days. [default: until it is removed]"
)
@by_option
@config_option
def add(name: str, role: str, days: int | None, by: str, config: Path | None) -> None:
    """Create a token for the system NAME and print it, this once. It is valid at once."""
    if not re.match(NAME, name):
        raise click.BadParameter("expected at most 40 letters, digits, spaces and _ . -", param_hint="NAME")
    home = load_configuration(config).home
    with direct_transaction(records_folder(home)) as connection:  # no token without its row, and no row without it
        append_audit(
            connection, AuditEntry(by, _ROLE, "token.added", f"token {name}", new={"role": role, "days": days})
        )
        token = ApiTokens(home / FOLDER).add(name, Role(role), days)
    click.echo(token)


@api_token.command("list")
@config_option
def list_all(config: Path | None) -> None:
    """List the tokens by their names; the tokens themselves are not stored."""
    for name, token in sorted(ApiTokens(load_configuration(config).home / FOLDER).all().items()):
        ends = "" if token.expires_utc_ms is None else f", expires {_time(token.expires_utc_ms)}"
        click.echo(f"{name:40}  {token.role:10}  made {_time(token.made_utc_ms)}{ends}")


@api_token.command()
@click.argument("name")
@by_option
@config_option
def remove(name: str, by: str, config: Path | None) -> None:
    """Withdraw the token of the system NAME; its next request is refused."""
    home = load_configuration(config).home
    with direct_transaction(records_folder(home)) as connection:
        append_audit(connection, AuditEntry(by, _ROLE, "token.removed", f"token {name}"))
        ApiTokens(home / FOLDER).remove(name)


def _time(utc_ms: int) -> str:
    return f"{datetime.fromtimestamp(utc_ms / 1000, UTC):%Y-%m-%d %H:%M} UTC"
