"""The configuration as it was when it was last good: what the station runs by while its file is broken."""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from station.service.keeping import Kept
from station.settings.configuration import Configuration, load_configuration
from station.settings.environment import CONFIG_VARIABLE, variable
from station.settings.problems import SettingsError

_FOLDER = "last_good"


def load_or_last_good(file: Path | None, environ: Mapping[str, str] | None = None) -> tuple[Configuration, str]:
    """Read the configuration; where it is broken, take the last good one of the same file.

    A good one is kept in its home folder. Of a broken one the home folder is not known: it is looked for where the
    environment says, beside the file, and at the default.

    Args:
        file: the file that the user named; found as `load_configuration` does where None.
        environ: the environment; the process's own by default.

    Returns:
        The configuration, and what is wrong with its files now; empty where nothing is.

    Raises:
        SettingsError: it is broken, and there is no last good one.
    """
    environ = os.environ if environ is None else environ
    name = f"{_FOLDER}/{_key(file, environ)}.json"
    try:
        configuration = load_configuration(file, environ)
    except SettingsError as error:
        for home in _homes(file, environ):
            data = Kept(home).read(name)
            if data is not None:
                try:
                    return Configuration.model_validate_json(data), str(error)
                except ValidationError:
                    continue
        raise
    Kept(configuration.home).write(name, configuration.model_dump_json().encode())
    return configuration, ""


def _key(file: Path | None, environ: Mapping[str, str]) -> str:
    """A name for where the configuration came from, so that two stations' are never mixed up."""
    named = file or environ.get(CONFIG_VARIABLE) or ""
    place = str(Path(named).absolute()) if named else "default"
    return hashlib.sha256(place.encode()).hexdigest()[:16]


def _homes(file: Path | None, environ: Mapping[str, str]) -> list[Path]:
    """Where the home folder may be, likeliest first."""
    default = Configuration().home
    homes = [environ[variable(("home",))]] if environ.get(variable(("home",))) else []
    named = file or environ.get(CONFIG_VARIABLE)
    if named:
        beside = Path(named).absolute().parent
        homes += [beside / default, beside]
    return [Path(home).absolute() for home in (*homes, default)]
