"""Migration of the site's configuration to another release."""

import shutil
import tempfile
from pathlib import Path

from installer.layout import Layout
from installer.messages import Failed, Refused, print_progress
from installer.programs import run


def try_with(layout: Layout, release: Path) -> tuple[str, ...]:
    """Check on a copy whether the configuration is valid in the next release; return the changes that it needs.

    Raises:
        Refused: it is invalid; with all problems.
    """
    program = release / "venv" / "bin" / "station"
    with tempfile.TemporaryDirectory(prefix="station-config-") as folder:
        copy = Path(folder) / layout.configuration.name
        shutil.copyfile(layout.configuration, copy)
        try:
            output = run(program, "config", "migrate", "--write", copy, environment=layout.environment())
            run(program, "config", "check", "--config", copy, environment=layout.environment())
        except Failed as error:
            wrong = str(error).partition("\n")[2].replace(str(copy), str(layout.configuration))
            raise Refused(f"{layout.configuration} is not good for {release.name}:\n{wrong}") from error
    changes = tuple(line.removeprefix(f"{copy}: ") for line in output.splitlines())
    return () if changes == ("nothing to change",) else changes


def migrate(layout: Layout, release: Path) -> None:
    """Migrate the configuration to a release. Idempotent."""
    program = release / "venv" / "bin" / "station"
    output = run(program, "config", "migrate", "--write", layout.configuration, environment=layout.environment())
    for line in output.splitlines():
        print_progress(line)
