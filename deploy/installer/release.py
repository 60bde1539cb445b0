"""A release: the program in a folder of its own, unchanged once it is complete."""

import hashlib
import shutil
import sys
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from installer.layout import Layout, read_note, write_note
from installer.messages import Refused, print_progress
from installer.programs import LONG_S, run

LOCKS = ("requirements-build.lock", "requirements.lock")
PACKAGES = ("station", "plc_interface", "hmi", "recipes")
COPIED = ("deploy", "docs")
STAMP = "release.json"
ROOM_BYTES = 1_500_000_000
"""Of a release and of what pip unpacks meanwhile: measured, docs/deployment.md, and half as much again."""


@dataclass(frozen=True)
class Source:
    """A checkout or an unpacked archive of the project: `pyproject.toml`, the locks, the packages and `deploy`."""

    folder: Path

    @cached_property
    def version(self) -> str:
        """Version in `pyproject.toml`."""
        return tomllib.loads((self.folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

    @property
    def name(self) -> str:
        """The release's name: the version, and eight digits of the fingerprint."""
        return f"{self.version}+{self.fingerprint[:8]}"

    @cached_property
    def fingerprint(self) -> str:
        """Hash of all that is installed from here."""
        digest = hashlib.sha256()
        for file in self._files():
            digest.update(f"{file.relative_to(self.folder)}\0".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
        return digest.hexdigest()

    @property
    def schema_version(self) -> str:
        """Schema version to which it migrates the records, as its migrations name it."""
        found = (self.folder / "station" / "records" / "migrations" / "versions").glob("[0-9]*.py")
        return max((path.name.partition("_")[0] for path in found), default="")

    def check(self) -> None:
        """Check that all parts exist.

        Raises:
            Refused: one is missing.
        """
        wanted = ("pyproject.toml", "README.md", "LICENSE", *LOCKS, *PACKAGES, *COPIED)
        missing = [name for name in wanted if not (self.folder / name).exists()]
        if missing:
            raise Refused(
                f"{self.folder} has no {', '.join(missing)}: run deploy/install of a checkout or an unpacked archive "
                "of the project, not a copy of it alone"
            )

    def _files(self) -> Iterator[Path]:
        for name in ("pyproject.toml", *LOCKS):
            yield self.folder / name
        for package in (*PACKAGES, "deploy"):
            found = sorted(path for path in (self.folder / package).rglob("*") if path.is_file())
            yield from (path for path in found if "__pycache__" not in path.parts)


@dataclass(frozen=True, slots=True)
class Packages:
    """Source of the locked packages; the package index by default."""

    wheels: Path | None = None
    """A folder of wheels, for a machine without internet; their hashes are checked all the same."""
    environment: Path | None = None
    """A virtual environment that has them already; the release needs it for as long as it is there."""


def complete(release: Path) -> bool:
    """Return whether a release is complete."""
    return bool(read_note(release / STAMP))


def make(layout: Layout, source: Source, packages: Packages) -> Path:
    """Build the release of a source, unless it is there. An incomplete one is built again.

    Raises:
        Failed: pip failed; see its message. The incomplete build is no release and does no harm.
    """
    release = layout.releases / source.name
    if complete(release):
        return release
    began = time.monotonic()
    shutil.rmtree(release, ignore_errors=True)
    release.mkdir(parents=True)
    for name in COPIED:
        shutil.copytree(source.folder / name, release / name, ignore=shutil.ignore_patterns("__pycache__"))
    _make_environment(release / "venv", source.folder, packages)
    run(release / "venv" / "bin" / "station", "--version", environment=layout.environment())
    _open_to_all(release)
    size_bytes = sum(file.lstat().st_size for file in release.rglob("*") if file.is_file() and not file.is_symlink())
    stamp = {"version": source.version, "fingerprint": source.fingerprint, "python": sys.version, "bytes": size_bytes}
    write_note(release / STAMP, stamp)
    print_progress(f"made {release.name}: {size_bytes / 1e6:.0f} MB in {time.monotonic() - began:.0f} s")
    return release


def _make_environment(venv: Path, source: Path, packages: Packages) -> None:
    python = venv / "bin" / "python"
    project = ("install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", "--ignore-installed", source)
    if packages.environment is not None:
        run(sys.executable, "-m", "venv", "--without-pip", venv)
        theirs = packages.environment / "bin" / "python"
        code = "import sysconfig; print(sysconfig.get_path('purelib'))"
        lent = run(theirs, "-c", code).strip()
        ours = Path(run(python, "-c", code).strip())
        (ours / "lent.pth").write_text(f"{lent}\n", encoding="utf-8")
        run(theirs, "-m", "pip", "--python", python, *project)
        return
    run(sys.executable, "-m", "venv", venv)
    pip = (python, "-m", "pip", "--disable-pip-version-check", "--no-input")
    where = ("--no-index", "--find-links", packages.wheels) if packages.wheels else ()
    locks = [part for lock in LOCKS for part in ("-r", source / lock)]
    run(*pip, "install", "--quiet", "--no-cache-dir", "--require-hashes", "--no-deps", *where, *locks, limit_s=LONG_S)
    run(*pip, *project)


def _open_to_all(release: Path) -> None:
    """Make root's files readable for the station's user, independent of root's umask."""
    for path in (release, *release.rglob("*")):
        if not path.is_symlink():
            mode = path.stat().st_mode & 0o7777
            path.chmod(mode | (0o055 if path.is_dir() or mode & 0o100 else 0o044))
