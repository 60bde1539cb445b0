"""Layout of an installation, below `/` or below a scratch root."""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NAME = "fruit-station"
UNIT = f"{NAME}.service"
TIMER = f"{NAME}-backup.timer"


@dataclass(frozen=True, slots=True)
class Layout:
    """Paths of one installation.

    Args:
        root: `/`, or a scratch root.
    """

    root: Path

    @property
    def is_system(self) -> bool:
        """True for the running system, False for a scratch root."""
        return self.root == Path("/")

    def place(self, path: str) -> Path:
        """Return a path of the system, below the root.

        Args:
            path: absolute, as the system has it.
        """
        return self.root / path.lstrip("/")

    @property
    def program(self) -> Path:
        """The installed releases, and the installer's notes of them."""
        return self.place(f"/opt/{NAME}")

    @property
    def releases(self) -> Path:
        """A folder for each release."""
        return self.program / "releases"

    @property
    def current(self) -> Path:
        """A link to the release in use."""
        return self.program / "current"

    @property
    def previous(self) -> Path:
        """A link to the release before it, for a rollback."""
        return self.program / "previous"

    @property
    def manifest(self) -> Path:
        """Note of the files and folders outside `program` that belong to the installer."""
        return self.program / "installed.json"

    @property
    def upgrade(self) -> Path:
        """Note of the release before the last upgrade, and its backup."""
        return self.program / "upgrade.json"

    @property
    def settings(self) -> Path:
        """The site's configuration and certificates."""
        return self.place(f"/etc/{NAME}")

    @property
    def configuration(self) -> Path:
        """The configuration's file."""
        return self.settings / "station.yaml"

    @property
    def home(self) -> Path:
        """The station's state."""
        return self.place(f"/var/lib/{NAME}")

    @property
    def recipes(self) -> Path:
        """The site's recipes, which the pages edit."""
        return self.home / "recipes"

    @property
    def backups(self) -> Path:
        """Backups of records, state and configuration."""
        return self.place(f"/var/backups/{NAME}")

    @property
    def cache(self) -> Path:
        """Data that may be lost."""
        return self.place(f"/var/cache/{NAME}")

    def environment(self) -> dict[str, str]:
        """Environment of the station's commands, with this installation and no other configuration."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("STATION_", "PYTHON"))}
        return {**kept, "STATION_CONFIG": str(self.configuration), "STATION_HOME": str(self.home)}


def target(link: Path) -> Path | None:
    """Return the release that a link points to, or None.

    Args:
        link: `current` or `previous` of a layout.
    """
    return link.resolve() if link.is_symlink() and link.exists() else None


def point(link: Path, release: Path) -> None:
    """Point a link to a release, atomically.

    Args:
        link: as above.
        release: a folder beside or below it.
    """
    new = link.with_name(f".{link.name}.new")
    new.unlink(missing_ok=True)
    new.symlink_to(os.path.relpath(release, link.parent))
    new.replace(link)


def write_note(file: Path, content: Any) -> None:
    """Write a note of the installer atomically."""
    new = file.with_name(f".{file.name}.new")
    new.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    new.replace(file)


def read_note(file: Path) -> dict[str, Any]:
    """Read a note of the installer; empty if there is none that can be read."""
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
