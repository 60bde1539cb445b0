"""Last good configuration: the station's processes run by it while its file is broken."""

import contextlib
import hashlib
import logging
import os
from pathlib import Path

from pydantic import ValidationError

from station.settings.configuration import Configuration, load_configuration
from station.settings.environment import CONFIG_VARIABLE, variable
from station.settings.problems import SettingsError
from station.state_files import StateFiles

_FOLDER = "last_good"

log = logging.getLogger(__name__)


def load_or_last_good(file: Path | None) -> tuple[Configuration, str]:
    """Read the configuration; if it is broken, return the last good one of the same file.

    A good configuration is stored in its home folder. A broken one does not name its home folder: the folder of the
    environment, the file's folder and the default are searched. The use of the last good one is logged.

    Args:
        file: the file that the user named; None: found as `load_configuration` does.

    Returns:
        The configuration, and the error in its files; empty for none.

    Raises:
        SettingsError: it is broken, and there is no last good one.
    """
    configuration, broken = read_or_last_good(file)
    if broken:
        log.warning("%s; the last good configuration is used", broken)
    else:
        StateFiles(configuration.home).write(_name(file), configuration.model_dump_json().encode())
    return configuration, broken


def read_or_last_good(file: Path | None) -> tuple[Configuration, str]:
    """Read the configuration or the last good one, as `load_or_last_good` does, without storing or logging."""
    try:
        return load_configuration(file), ""
    except SettingsError as error:
        last_good = read_last_good(file)
        if last_good is None:
            raise
        return last_good, str(error)


def read_last_good(file: Path | None) -> Configuration | None:
    """Return the last good configuration of a file, as `load_or_last_good` does; None for none."""
    for home in _homes(file):
        with contextlib.suppress(OSError, ValidationError):
            return Configuration.model_validate_json((home / _name(file)).read_bytes())
    return None


def _name(file: Path | None) -> str:
    """Return the file's name in the home folder, by the source, so that those of two stations are never mixed up."""
    named = file or os.environ.get(CONFIG_VARIABLE) or ""
    place = str(Path(named).absolute()) if named else "default"
    return f"{_FOLDER}/{hashlib.sha256(place.encode()).hexdigest()[:16]}.json"


def _homes(file: Path | None) -> list[Path]:
    """Return the possible home folders, likeliest first."""
    default = Configuration().home
    homes = [os.environ[variable(("home",))]] if os.environ.get(variable(("home",))) else []
    named = file or os.environ.get(CONFIG_VARIABLE)
    if named:
        beside = Path(named).absolute().parent
        homes += [beside / default, beside]
    return [Path(home).absolute() for home in (*homes, default)]
