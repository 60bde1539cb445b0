"""Installation and upgrade: prepared and checked beside the running release, then switched, or rolled back."""

import shutil
import sqlite3
from collections.abc import Callable
from typing import NamedTuple

from installer import backup, configuration, preflight, site_files
from installer.health import LIMIT_S, ready, wait_until_healthy
from installer.layout import NAME, Layout, point, read_note, target, write_note
from installer.messages import Failed, Refused, print_progress
from installer.release import ROOM_BYTES, STAMP, Packages, Source, complete, make
from installer.rollback import roll_back
from installer.services import Services

_BACKUPS_KEPT = 3


class Step(NamedTuple):
    """One step, announced before it is done."""

    sentence: str
    do: Callable[[], object]


class Installation:
    """One run of the installer; the station has `limit_s` to become healthy."""

    def __init__(
        self, layout: Layout, services: Services, source: Source, packages: Packages, limit_s: float = LIMIT_S
    ) -> None:
        self._layout, self._services, self._source, self._packages = layout, services, source, packages
        self._limit_s = limit_s
        self.release = layout.releases / source.name
        self._old = target(layout.current)
        self._was_ready = False
        self._changes: tuple[str, ...] = ()

    @property
    def is_upgrade(self) -> bool:
        """True if another release is in use."""
        return self._old is not None and self._old != self.release and complete(self._old)

    def check(self, *, during_lot: bool) -> None:
        """Check that it can be done, and during a lot only where that is allowed.

        Raises:
            Refused: it cannot be done.
        """
        preflight.check_machine(self._layout)
        release_bytes = 0 if complete(self.release) else ROOM_BYTES
        if release_bytes or self.is_upgrade:
            preflight.check_disk_space(self._layout, release_bytes, migrates=self._migrates())
        if self.is_upgrade and self._old is not None and not during_lot:
            preflight.check_no_lot(self._layout, self._old)

    def _migrates(self) -> bool:
        """Return whether the release brings the records to another schema when it opens them."""
        try:
            found = backup.schema_version(self._layout.home / backup.RECORDS)
        except sqlite3.Error:  # their backup reports it
            return False
        return found not in ("", self._source.schema_version)

    def steps(self) -> list[Step]:
        """Return the steps in order. Each may be repeated; together they lead to the goal from any state between."""
        layout, name = self._layout, self.release.name
        upgrading = [
            Step(f"check whether {layout.configuration} is valid for {name}", self._try_configuration),
            Step(f"copy records, state and configuration to {layout.backups}", self._make_backup),
            Step("stop the running station", self._services.stop),
            Step(
                f"migrate {layout.configuration} to {name}",
                lambda: configuration.migrate(layout, self.release),
            ),
        ]
        return [
            Step(f"make the release {name} in {layout.releases}", self._make),
            *(upgrading if self.is_upgrade else []),
            Step("put units, rules and the command `station` in place", lambda: site_files.put(layout, self.release)),
            Step(f"make the user, {layout.settings}, {layout.home} and {layout.backups}", self._make_places),
            Step(f"point {layout.current} to {name}", lambda: point(layout.current, self.release)),
            Step("start the station now and at each boot, and wait until it is healthy", self._start),
            Step("remove releases that are neither in use nor the one before", self._remove_old),
        ]

    def run(self) -> None:
        """Carry out the steps.

        Raises:
            Refused: the configuration is not valid in the new release; the old one runs on.
            Failed: a step failed. After a failed upgrade, the old release is in use again, or the text says why not.
        """
        # From the stop of the old release until the new one is healthy, a failure rolls back.
        under_way = False
        for step in self.steps():
            print_progress(step.sentence)
            under_way |= self.is_upgrade and step.do == self._services.stop
            try:
                step.do()
                under_way &= step.do != self._start
            except (Failed, OSError) as error:
                if not under_way:
                    raise
                print_progress(str(error))
                self._roll_back()
                old = self._old.name if self._old else "nothing"
                raise Failed(f"{self.release.name} is not in use: {old} is again; correct the cause") from error

    def _roll_back(self) -> None:
        try:
            roll_back(self._layout, self._services, self._limit_s)
        except Refused as refusal:
            raise Failed(f"the upgrade cannot be taken back: {refusal}; then deploy/install --rollback") from refusal

    def _make(self) -> None:
        site_files.make_folder(self._layout, self._layout.program)
        make(self._layout, self._source, self._packages)

    def _try_configuration(self) -> None:
        self._changes = configuration.try_with(self._layout, self.release)

    def _make_backup(self) -> None:
        assert self._old is not None  # noqa: S101 (an upgrade has one)
        self._was_ready = self._services.running() and ready(self._layout, self._old)
        # Its disk may be a new one.
        site_files.make_place(self._layout, self._layout.backups, NAME)
        copy = backup.make_backup_as_user(self._layout, self.release, backup.BEFORE_UPGRADE, _BACKUPS_KEPT)
        note = {"from": self._old.name, "to": self.release.name}
        before = read_note(self._layout.upgrade)
        # An interrupted upgrade, also to another release, may have changed the file: the earlier note has it as before.
        known = before.get("configuration") if before.get("from") == self._old.name else None
        text = known
        if text is None and self._changes:
            text = self._layout.configuration.read_text(encoding="utf-8")
        schema = backup.schema_version(copy / backup.RECORDS)
        write_note(self._layout.upgrade, {**note, "copy": copy.name, "schema": schema, "configuration": text})
        point(self._layout.previous, self._old)

    def _make_places(self) -> None:
        self._services.make_user()
        site_files.make_folders(self._layout, self._source.folder / "recipes")

    def _start(self) -> None:
        self._services.reload()
        self._services.enable()
        if self._services.start():
            wait_until_healthy(
                self._layout, self.release, self._source.version, was_ready=self._was_ready, limit_s=self._limit_s
            )

    def _remove_old(self) -> None:
        kept = {self.release, target(self._layout.previous)}
        for release in self._layout.releases.iterdir():
            if release not in kept:
                (release / STAMP).unlink(missing_ok=True)
                shutil.rmtree(release)
                print_progress(f"removed {release.name}")
