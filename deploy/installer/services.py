"""System services: systemd, or the unit files of a scratch root."""

# ruff: noqa: D102 (Systemd documents each method)

import os
import shutil
from pathlib import Path

from installer.layout import NAME, TIMER, UNIT, Layout
from installer.messages import Failed, print_progress
from installer.programs import run

_START_LIMIT_S, _STOP_LIMIT_S = 4200.0, 260.0
"""Longer than the unit's own limits, which end it: a start that migrates the records of years extends its limit, by an
hour at most."""


class Systemd:
    """The running system's services."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        # In a container or a chroot systemd does not answer; its files are still put in place.
        self._booted = Path("/run/systemd/system").is_dir()

    def make_user(self) -> None:
        """Create the station's user. Idempotent."""
        run("systemd-sysusers", f"{NAME}.conf")

    def remove_user(self) -> None:
        """Remove the station's user. Idempotent."""
        _remove_user(self._layout)

    def enable(self) -> None:
        """Enable the station and its backups at each boot."""
        run("systemctl", "enable", UNIT, TIMER)
        if self._booted:
            run("systemctl", "start", TIMER)

    def disable(self) -> None:
        """Disable them; they are stopped already."""
        if self._booted:
            run("systemctl", "stop", TIMER)
        run("systemctl", "disable", UNIT, TIMER)

    def reload(self) -> None:
        """Reload changed units and device rules."""
        if not self._booted:
            return
        run("systemctl", "daemon-reload")
        if Path("/run/udev/control").exists():
            run("udevadm", "control", "--reload")
            run("udevadm", "trigger", "--subsystem-match=video4linux", "--subsystem-match=tty")

    def running(self) -> bool:
        """Return whether the station runs, or is about to."""
        if not self._booted:
            return False
        try:
            run("systemctl", "is-active", "--quiet", UNIT)
        except Failed:
            return False
        return True

    def stop(self) -> None:
        """Stop the station in order. Idempotent."""
        if self._booted:
            run("systemctl", "stop", UNIT, limit_s=_STOP_LIMIT_S)

    def start(self) -> bool:
        """Start it; returns False where nothing can be started, as in a scratch root.

        Raises:
            Failed: it did not become ready.
        """
        if not self._booted:
            print_progress("systemd does not run here: the station starts when it does")
            return False
        run("systemctl", "reset-failed", UNIT)
        run("systemctl", "start", UNIT, limit_s=_START_LIMIT_S)
        return True


class ScratchRoot:
    """A folder that represents a system which does not run: links and users are made in it, nothing is started."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._users = layout.place("/etc/passwd")

    def make_user(self) -> None:
        if self._users.exists() and os.geteuid() == 0:
            run("systemd-sysusers", f"--root={self._layout.root}", f"{NAME}.conf")

    def remove_user(self) -> None:
        _remove_user(self._layout, "--prefix", str(self._layout.root))

    def enable(self) -> None:
        self._systemctl("enable")

    def disable(self) -> None:
        self._systemctl("disable")

    def reload(self) -> None:
        return

    def running(self) -> bool:
        return False

    def stop(self) -> None:
        return

    def start(self) -> bool:
        print_progress(f"nothing is started in {self._layout.root}")
        return False

    def _systemctl(self, verb: str) -> None:
        if shutil.which("systemctl"):
            run("systemctl", f"--root={self._layout.root}", verb, UNIT, TIMER)


Services = Systemd | ScratchRoot
"""What the installer does with the system's services."""


def _remove_user(layout: Layout, *options: str) -> None:
    """Remove the user and the group of that name; the group goes with the user only if login.defs has it so."""
    for file, program in (("/etc/passwd", "userdel"), ("/etc/group", "groupdel")):
        listed = layout.place(file)
        if listed.exists() and any(line.startswith(f"{NAME}:") for line in listed.read_text("utf-8").splitlines()):
            run(program, *options, NAME)
