"""Where everything lies, below `/` or below a scratch root."""

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
    """The places of one installation.

    Args:
        root: `/`, or a folder that stands for it.
    """

    root: Path

    @property
    def is_system(self) -> bool:
        """Whether this is the running system and no scratch root."""
        return self.root == Path("/")

    def place(self, path: str) -> Path:
        """A path of the system, below the root.

        Args:
            path: absolute, as the system has it.
        """
        return self.root / path.lstrip("/")

    @property
    def program(self) -> Path:
        """The installed releases, and what is noted of them."""
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
        """What lies outside `program` and is the installer's."""
        return self.program / "installed.json"

    @property
    def upgrade(self) -> Path:
        """Where the last upgrade came from, and its backup."""
        return self.program / "upgrade.json"

    @property
    def settings(self) -> Path:
        """The site's configuration, certificates and recipes."""
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
    def backups(self) -> Path:
        """Copies of records, state and configuration."""
        return self.place(f"/var/backups/{NAME}")

    @property
    def cache(self) -> Path:
        """What may be lost."""
        return self.place(f"/var/cache/{NAME}")

    def environment(self) -> dict[str, str]:
        """The environment in which the station's commands find this installation, and no other configuration."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("STATION_", "PYTHON"))}
        return {**kept, "STATION_CONFIG": str(self.configuration), "STATION_HOME": str(self.home)}


def target(link: Path) -> Path | None:
    """The release that a link leads to, or None where it leads nowhere.

    Args:
        link: `current` or `previous` of a layout.
    """
    return link.resolve() if link.is_symlink() and link.exists() else None


def point(link: Path, release: Path) -> None:
    """Have a link lead to a release, from one moment to the next.

    Args:
        link: as above.
        release: a folder beside or below it.
    """
    new = link.with_name(f".{link.name}.new")
    new.unlink(missing_ok=True)
    new.symlink_to(os.path.relpath(release, link.parent))
    new.replace(link)


def write_note(file: Path, content: Any) -> None:
    """Write a note of the installer whole, or not at all.

    Args:
        file: where.
        content: what JSON can hold.
    """
    new = file.with_name(f".{file.name}.new")
    new.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    new.replace(file)


def read_note(file: Path) -> dict[str, Any]:
    """A note of the installer; empty where there is none that can be read.

    Args:
        file: where.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
