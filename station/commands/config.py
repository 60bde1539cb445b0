"""`station config`: show, check and migrate the configuration."""

import ipaddress
import os
from pathlib import Path

import click

from station.atomic_file import write_atomically
from station.config_option import config_option
from station.messages import settings as messages
from station.settings.conduits import Zone
from station.settings.configuration import load_configuration
from station.settings.file_content import read_content
from station.settings.firewall import rules
from station.settings.migration import migrated
from station.settings.problems import Problem, SettingsError


def _networks(_context: click.Context, _option: click.Parameter, given: tuple[str, ...]) -> tuple[str, ...]:
    try:
        return tuple(str(ipaddress.ip_network(each.strip())) for text in given for each in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{error}; write 10.10.30.5 or 10.10.30.0/24") from error


def _zones(context: click.Context, option: click.Parameter, given: tuple[str, ...]) -> dict[Zone, tuple[str, ...]]:
    known = {zone.value: zone for zone in Zone if zone is not Zone.STATION}
    found: dict[Zone, tuple[str, ...]] = {}
    for text in given:
        name, _, networks = text.partition("=")
        if name not in known:
            raise click.BadParameter(f"{name!r} is no zone: {', '.join(known)}")
        found[known[name]] = _networks(context, option, (networks,))
    return found


@click.group()
def config() -> None:
    """Show the configuration, check it, and migrate an earlier program's."""


@config.command()
@config_option
def check(config: Path | None) -> None:
    """Check the configuration with its environment variables, and report all errors."""
    site = load_configuration(config)
    click.echo(f"OK: home {site.home}, camera {site.camera.driver}, arm {site.arm.host}, gripper {site.gripper.driver}")


@config.command()
@config_option
def show(config: Path | None) -> None:
    """Show the configuration in force, as JSON: defaults, overridden by the file, overridden by the environment."""
    click.echo(load_configuration(config).model_dump_json(indent=2))


@config.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--write", is_flag=True, help="Change FILE; without it, the changes are only printed.")
def migrate(file: Path, *, write: bool) -> None:
    """Migrate FILE, a station.yaml of an earlier program, to this program's terms. Repeating it changes nothing.

    Comments stay. The file is replaced atomically, with its owner and permissions.
    """
    changed = migrated(read_content(file), str(file))
    for change in changed.changes:
        click.echo(f"{file}: {change}")
    if not changed.changes:
        click.echo(f"{file}: nothing to change")
    elif write:
        _replace(file, changed.text)


@config.command()
@config_option
@click.option(
    "--zone", "zones", metavar="NAME=ADDRESS,…", multiple=True, callback=_zones,
    help="Addresses or networks of a zone: cell, line, operators, monitoring, archive. May be repeated.",
)  # fmt: skip
@click.option(
    "--maintenance", metavar="ADDRESS", multiple=True, callback=_networks, help="From where SSH, time and names come."
)
def firewall(config: Path | None, zones: dict[Zone, tuple[str, ...]], maintenance: tuple[str, ...]) -> None:
    """Write nftables rules that open what this configuration uses, for the given zones, and nothing else."""
    click.echo(rules(load_configuration(config), zones, maintenance), nl=False)


def _replace(file: Path, text: str) -> None:
    try:
        was = file.stat()
        owner = (was.st_uid, was.st_gid) if os.geteuid() == 0 else None
        write_atomically(file, text.encode(), was.st_mode & 0o7777, owner=owner)
    except OSError as error:
        expected = messages.UNWRITABLE(error=error.strerror or str(error))
        raise SettingsError([Problem(messages.PATH(path=str(file)), messages.FILE(), expected)]) from error
