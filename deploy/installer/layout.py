"""Layout of an installation, below `/` or below a scratch root."""

import json
import os
from pathlib import Path
from typing import Any

NAME = "fruit-station"
UNIT = f"{NAME}.service"
TIMER = f"{NAME}-backup.timer"


class Layout:
    """Paths of one installation, below `/` or a scratch root."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.is_system = root == Path("/")
        """True for the running system, False for a scratch root."""
        self.program = self.place(f"/opt/{NAME}")
        """The installed releases, and the installer's notes of them."""
        self.releases = self.program / "releases"
        """A folder for each release."""
        self.current = self.program / "current"
        """A link to the release in use."""
        self.previous = self.program / "previous"
        """A link to the release before it, for a rollback."""
        self.manifest = self.program / "installed.json"
        """Note of the files and folders outside `program` that belong to the installer."""
        self.upgrade = self.program / "upgrade.json"
        """Note of the release before the last upgrade, and its backup."""
        self.settings = self.place(f"/etc/{NAME}")
        """The site's configuration and certificates."""
        self.configuration = self.settings / "station.yaml"
        """The configuration's file."""
        self.home = self.place(f"/var/lib/{NAME}")
        """The station's state."""
        self.recipes = self.home / "recipes"
        """The site's recipes, which the pages edit."""
        self.backups = self.place(f"/var/backups/{NAME}")
        """Backups of records, state and configuration."""
        self.cache = self.place(f"/var/cache/{NAME}")
        """Data that may be lost."""

    def place(self, path: str) -> Path:
        """Return an absolute path of the system, below the root."""
        return self.root / path.lstrip("/")

    def environment(self) -> dict[str, str]:
        """Environment of the station's commands, with this installation and no other configuration."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("STATION_", "PYTHON"))}
        return {**kept, "STATION_CONFIG": str(self.configuration), "STATION_HOME": str(self.home)}


def target(link: Path) -> Path | None:
    """Return the release that a link, `current` or `previous` of a layout, points to; or None."""
    return link.resolve() if link.is_symlink() and link.exists() else None


def point(link: Path, release: Path) -> None:
    """Point a link, as above, to a release's folder beside or below it, atomically."""
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
