"""`station api-token`: the tokens of the systems that use the HTTP API."""

import re
from datetime import UTC, datetime
from pathlib import Path

import click

from hmi.api.tokens import NAME, ROLES, ApiTokens
from hmi.web.roles import Role
from station.settings.configuration import load_configuration

_CONFIG = click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="The station.yaml to use.")


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
@_CONFIG
def add(name: str, role: str, config: Path | None) -> None:
    """Create a token for the system NAME and print it, this once. It is valid at once, and until it is removed."""
    if not re.match(NAME, name):
        raise click.BadParameter("expected at most 40 letters, digits, spaces and _ . -", param_hint="NAME")
    click.echo(_tokens(config).add(name, Role(role)))


@api_token.command("list")
@_CONFIG
def list_all(config: Path | None) -> None:
    """List the tokens by their names; the tokens themselves are not stored."""
    for name, token in sorted(_tokens(config).all().items()):
        made = datetime.fromtimestamp(token.made_utc_ms / 1000, UTC)
        click.echo(f"{name:40}  {token.role:10}  made {made:%Y-%m-%d %H:%M} UTC")


@api_token.command()
@click.argument("name")
@_CONFIG
def remove(name: str, config: Path | None) -> None:
    """Withdraw the token of the system NAME; its next request is refused."""
    _tokens(config).remove(name)


def _tokens(config: Path | None) -> ApiTokens:
    return ApiTokens(load_configuration(config).home / "hmi")
