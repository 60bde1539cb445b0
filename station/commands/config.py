"""`station config`: look at the configuration, check it, and bring an earlier program's up to date."""

import os
from pathlib import Path

import click

from station.settings.configuration import load_configuration
from station.settings.migration import migrated
from station.settings.problems import Problem, SettingsError
from station.settings.yaml_loader import LARGEST_FILE_BYTES

_config = click.option(
    "--config",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The configuration. [default: STATION_CONFIG, or station.yaml in STATION_HOME]",
)


@click.group()
def config() -> None:
    """Look at the configuration, check it, and bring an earlier program's up to date."""


@config.command()
@_config
def check(config: Path | None) -> None:
    """Check the configuration with its environment variables, and say all that is wrong; exit code 2 if any."""
    site = load_configuration(config)
    click.echo(f"OK: home {site.home}, camera {site.camera.driver}, arm {site.arm.host}, gripper {site.gripper.driver}")


@config.command()
@_config
def show(config: Path | None) -> None:
    """Show what is in force, as JSON: defaults, overridden by the file, overridden by the environment."""
    click.echo(load_configuration(config).model_dump_json(indent=2))


@config.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--write", is_flag=True, help="Change FILE; without it, only what would be changed is said.")
def migrate(file: Path, *, write: bool) -> None:
    """Bring FILE, a station.yaml of an earlier program, into this program's words. Doing so again changes nothing.

    Comments stay. The file is replaced whole or not at all, and keeps its owner and rights.
    """
    changed = migrated(_text(file), str(file))
    for change in changed.changes:
        click.echo(f"{file}: {change}")
    if not changed.changes:
        click.echo(f"{file}: nothing to change")
    elif write:
        _replace(file, changed.text)


def _text(file: Path) -> str:
    """A file's text, at most as long as the station reads."""
    try:
        with file.open("rb") as source:
            content = source.read(LARGEST_FILE_BYTES + 1)
        if len(content) > LARGEST_FILE_BYTES:
            raise SettingsError([Problem(str(file), "file", f"expected at most {LARGEST_FILE_BYTES} bytes")])
        return content.decode("utf-8-sig")
    except OSError as error:
        raise SettingsError([Problem(str(file), "file", f"cannot be read: {error.strerror}")]) from error
    except UnicodeDecodeError as error:
        raise SettingsError([Problem(str(file), "file", "expected UTF-8")]) from error


def _replace(file: Path, text: str) -> None:
    unfinished = file.with_name(f".{file.name}.new")
    try:
        was = file.stat()
        with unfinished.open("w", encoding="utf-8") as target:
            os.fchmod(target.fileno(), was.st_mode & 0o7777)
            if os.geteuid() == 0:
                os.fchown(target.fileno(), was.st_uid, was.st_gid)
            target.write(text)
            target.flush()
            os.fsync(target.fileno())
        unfinished.replace(file)
    except OSError as error:
        raise SettingsError([Problem(str(file), "file", f"cannot be written: {error.strerror}")]) from error
