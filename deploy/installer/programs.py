"""Subprocesses of the installer."""

import grp
import os
import pwd
import subprocess
from collections.abc import Mapping
from pathlib import Path

from installer.layout import NAME, Layout
from installer.messages import Failed

LONG_S = 4 * 3600.0
_LINES = 12


def run(
    *command: str | Path,
    environment: Mapping[str, str] | None = None,
    folder: Path | None = None,
    limit_s: float = 300.0,
) -> str:
    """Run a program to its end and return its output; its environment is the installer's own by default.

    Raises:
        Failed: it could not be started, did not end in time, or its exit code was not 0; with its last output.
    """
    words = [str(part) for part in command]
    try:
        done = subprocess.run(  # noqa: S603 (arguments of the installer, without a shell)
            words, env=environment, cwd=folder, capture_output=True, text=True, timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise Failed(f"{words[0]} did not end within {limit_s:g} s: {' '.join(words)}") from error
    except OSError as error:
        raise Failed(f"{words[0]} cannot be run: {error.strerror}") from error
    if done.returncode:
        last = "\n".join((done.stderr.strip() or done.stdout.strip()).splitlines()[-_LINES:])
        raise Failed(f"{' '.join(words)} ended with exit code {done.returncode}:\n{last}")
    return done.stdout


def station(layout: Layout, release: Path, *arguments: str | Path, limit_s: float = 120.0) -> str:
    """Run a command of an installed release, as the station's own user if possible, with the layout's configuration.

    Raises:
        Failed: as for `run`.
    """
    command = (release / "venv" / "bin" / "station", *arguments)
    if layout.is_system and os.geteuid() == 0 and known_user():
        command = ("runuser", "-u", NAME, "--", *command)
    return run(*command, environment=layout.environment(), folder=layout.program, limit_s=limit_s)


def become_user(layout: Layout) -> None:
    """Go on as the station's user where root runs this below `/`; for what works in folders that the user may write.

    In those it could put links to any file for root to follow. There is no way back.
    """
    if layout.is_system and os.geteuid() == 0 and known_user():
        user = pwd.getpwnam(NAME)
        os.initgroups(NAME, user.pw_gid)
        os.setgid(user.pw_gid)
        os.setuid(user.pw_uid)


def known_user() -> bool:
    """Return whether this system has the station's user."""
    try:
        pwd.getpwnam(NAME)
    except KeyError:
        return False
    return True


def own(layout: Layout, path: Path, user: str, group: str) -> None:
    """Change a path's owner; does nothing in a scratch root, as another user than root, or without that user.

    A link's own owner is changed: the station's user can put a link to any file into its folders.
    """
    if layout.is_system and os.geteuid() == 0 and known_user():
        os.chown(path, pwd.getpwnam(user).pw_uid, grp.getgrnam(group).gr_gid, follow_symlinks=False)
