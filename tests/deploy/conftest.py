"""Fixtures of the deployment's tests: the installer, sources of several versions, and a stand-in for systemd."""

import hashlib
import importlib
import os
import shutil
import socket
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
VENV = Path(sys.prefix)
PASSING = {"etc/.pwd.lock", "etc/passwd-", "etc/group-", "etc/shadow-", "etc/gshadow-"}
"""Made by the system's own tools for users, and theirs."""
IN_A_RELEASE = ("station", "plc_interface", "hmi", "recipes", "deploy", "docs")


@pytest.fixture
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture(autouse=True)
def quick_installing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiling is for those who run a program more than once."""
    monkeypatch.setenv("PIP_NO_COMPILE", "1")


@pytest.fixture
def installer(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Any]:
    """A module of the installer, by its name."""
    monkeypatch.syspath_prepend(str(ROOT / "deploy"))
    return lambda name: importlib.import_module(f"installer.{name}")


@pytest.fixture
def system(tmp_path: Path) -> Path:
    """A scratch root with the users and groups of a Debian; only root can make another user in it."""
    folder = tmp_path / "system"
    if os.geteuid() == 0:
        etc = folder / "etc"
        etc.mkdir(parents=True)
        (etc / "passwd").write_text("root:x:0:0:root:/root:/bin/bash\n")
        (etc / "group").write_text("root:x:0:\ndialout:x:20:\nvideo:x:44:\n")
        for name in ("shadow", "gshadow"):
            (etc / name).touch(mode=0o600)
    else:
        folder.mkdir()
    return folder


@pytest.fixture
def install(root: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `deploy/install` as a person does."""

    def run(*arguments: object, program: Path = root) -> subprocess.CompletedProcess[str]:
        command = [program / "deploy" / "install", *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, timeout=400, check=False)

    return run


def make_source(folder: Path, version: str, changes: dict[str, tuple[str, str]]) -> Path:
    """A copy of the project as another version, with some texts replaced: `{file: (old, new)}`."""
    for name in IN_A_RELEASE[:-1]:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "docs").mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE", "requirements.lock", "requirements-build.lock"):
        shutil.copy(ROOT / name, folder)
    for name, (old, new) in {"pyproject.toml": ('version = "0.1.0"', f'version = "{version}"'), **changes}.items():
        text = (folder / name).read_text(encoding="utf-8")
        assert old in text, f"{name} has no {old!r} any more"
        (folder / name).write_text(text.replace(old, new), encoding="utf-8")
    return folder


NEWER = {
    # A setting has another name, and the records have another form.
    "station/settings/hmi.py": ("    idle_s: float", "    logged_out_after_s: float"),
    "hmi/web/app.py": ("settings.idle_s", "settings.logged_out_after_s"),
    "station/settings/earlier_settings.py": (
        "MOVES = (", 'MOVES = (Move(("hmi", "idle_s"), ("hmi", "logged_out_after_s")), '
    ),
    # Without pages where a file requests so: it does not become ready.
    "hmi/web/process.py": (
        '        notify("READY=1")',
        '        if (site.home / "no-pages").exists():\n            raise SystemExit(1)\n        notify("READY=1")',
    ),
}  # fmt: skip
# A machine whose cores all are busy starts a process later than a packhouse's.
PATIENT = {
    "station/supervision/supervisor.py": (
        "start_limit_s: float = 60.0\n    watchdog_s: float = 10.0",
        "start_limit_s: float = 240.0\n    watchdog_s: float = 60.0",
    )
}
FORM = '''"""Another form."""

import sqlalchemy as sa
from alembic import op

revision = "9999"
down_revision = "{before}"


def upgrade() -> None:
    op.create_table("another", sa.Column("one", sa.Integer(), primary_key=True))
'''


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The project as two versions: as it is, and with a setting and the records changed."""
    folder = tmp_path_factory.mktemp("sources")
    made = {
        version: make_source(folder / version, version, changes)
        for version, changes in {"0.1.0": PATIENT, "0.2.0": {**PATIENT, **NEWER}}.items()
    }
    forms = made["0.2.0"] / "station" / "records" / "migrations" / "versions"
    newest = max(path.name[:4] for path in forms.glob("[0-9]*.py"))
    (forms / "9999_form.py").write_text(FORM.format(before=newest))
    return made


@pytest.fixture(scope="session")
def releases(sources: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scratch root in which the releases of both are made, and none is installed: making them takes long."""
    folder = tmp_path_factory.mktemp("releases")
    code = (
        "import sys; from pathlib import Path; from installer.layout import Layout; from installer.release import *; "
        "[make(Layout(Path(sys.argv[1])), Source(Path(source)), Packages(environment=Path(sys.prefix))) "
        "for source in sys.argv[2:]]"
    )
    environment = {**os.environ, "PIP_NO_COMPILE": "1", "PYTHONPATH": str(ROOT / "deploy")}
    subprocess.run(
        [sys.executable, "-c", code, folder, *sources.values()], env=environment, check=True, capture_output=True
    )
    return folder


@pytest.fixture
def tree_of() -> Callable[[Path], dict[str, tuple[int, str]]]:
    """Every path of a folder with its rights and its content."""

    def tree(folder: Path) -> dict[str, tuple[int, str]]:
        found = {}
        for path in sorted(folder.rglob("*")):
            name = str(path.relative_to(folder))
            if name in PASSING:
                continue
            content = str(path.readlink()) if path.is_symlink() else ""
            if path.is_file():
                content = hashlib.sha256(path.read_bytes()).hexdigest()
            found[name] = (stat.S_IMODE(path.lstat().st_mode), content)
        return found

    return tree


class StandIn:
    """Starts the unit's program of a scratch root and listens to it, as systemd does with `Type=notify`."""

    def __init__(self, installer: Callable[[str], Any], folder: Path) -> None:
        self.failed = installer("messages").Failed
        self.layout = installer("layout").Layout(folder)
        self.heard: list[str] = []
        self.process: subprocess.Popen[bytes] | None = None
        self._log = folder.parent / "station.log"
        self._address = folder.parent / "notify"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(self._address))
        self._socket.settimeout(0.2)
        self.make_user = self.remove_user = self.enable = self.disable = self.reload = lambda: None

    def running(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def start(self) -> bool:
        program = self.layout.current / "venv" / "bin" / "station"
        environment = {**self.layout.environment(), "NOTIFY_SOCKET": str(self._address)}
        self.heard = []
        with self._log.open("ab") as log:
            self.process = subprocess.Popen(
                [program, "run"], cwd=self.layout.home, env=environment, stdout=log, stderr=log
            )
        try:
            self.hear("READY=1")
        except AssertionError as error:
            raise self.failed(f"the unit did not start: {error}") from error
        return True

    def stop(self) -> None:
        if self.process is not None:
            self.process.terminate()
            self.process.wait(60)
            self._listen()

    def hear(self, word: str, limit_s: float = 240.0) -> None:
        """Wait until the program has sent this."""
        deadline_s = time.monotonic() + limit_s
        while word not in self.heard:
            ended = not self.running()
            self._listen()
            assert word in self.heard or not ended, f"it ended: {self._log.read_text()[-2000:]}"
            assert time.monotonic() < deadline_s, f"{word} was not heard, but {self.heard[-5:]}"

    def _listen(self) -> None:
        try:
            while True:
                self.heard += self._socket.recv(4096).decode().splitlines()
        except TimeoutError:
            return

    def close(self) -> None:
        self.stop()
        self._socket.close()


@pytest.fixture
def stand_in(installer: Callable[[str], Any], releases: Path) -> Iterator[StandIn]:
    """One for a scratch root in which the releases are made, whose path leaves room for the name of a socket."""
    with tempfile.TemporaryDirectory(prefix="root-") as folder:
        root = Path(folder) / "r"
        shutil.copytree(releases, root, symlinks=True)
        made = StandIn(installer, root)
        yield made
        made.close()


@pytest.fixture
def environment() -> Path:
    """The environment whose packages are borrowed: installing them anew takes minutes and a package index."""
    return VENV
