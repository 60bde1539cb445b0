"""Rollback to the release before the last upgrade, with data that this release can read."""

import shutil

from installer import backup, site_files
from installer.health import LIMIT_S, wait_until_well
from installer.layout import Layout, point, read_note, target
from installer.messages import Refused, print_progress
from installer.programs import own, station
from installer.release import STAMP, complete
from installer.services import Services


def check(layout: Layout) -> None:
    """Check that there is a release to roll back to, and that it can read the records, or the backup has older ones.

    Raises:
        Refused: there is none, or it cannot.
    """
    old, note = target(layout.previous), read_note(layout.upgrade)
    if old is None or not complete(old) or not note:
        raise Refused("there is no upgrade to take back: only the last one can be, and only once")
    copy = layout.backups / str(note["copy"])
    if not copy.is_dir() and note.get("schema") != backup.schema_version(layout.home / backup.RECORDS):
        raise Refused(
            f"{copy} is gone, and {old.name} cannot read the records as they are: put this backup back to its place"
        )


def roll_back(layout: Layout, services: Services, limit_s: float = LIMIT_S) -> None:
    """Roll the last upgrade back. An interrupted rollback is completed by another call.

    The configuration is restored if the upgrade had changed it; the records only if the old release cannot read them,
    and the inspections since the upgrade are then in their folder `aside`.

    Raises:
        Refused: there is no upgrade to roll back.
        Failed: a step failed.
    """
    check(layout)
    old, note = target(layout.previous), read_note(layout.upgrade)
    assert old is not None  # noqa: S101 (checked)
    print_progress(f"back to {old.name}")
    services.stop()
    copy = layout.backups / str(note["copy"])
    if note["configuration"] is not None:
        shutil.copyfile(
            layout.configuration, layout.configuration.with_name(f"{layout.configuration.name}.rolled-back")
        )
        layout.configuration.write_text(note["configuration"], encoding="utf-8")
        own(layout, layout.configuration, "root", "fruit-station")
        print_progress(f"{layout.configuration} is as before the upgrade")
    if (copy / backup.RECORDS).is_dir() and backup.schema_version(
        layout.home / backup.RECORDS
    ) != backup.schema_version(copy / backup.RECORDS):
        station(layout, old, "records", "restore", copy / backup.RECORDS, limit_s=4 * 3600.0)
        print_progress(
            f"the records are as before the upgrade; what came since is in {layout.home / backup.RECORDS / 'aside'}"
        )
    site_files.put(layout, old)
    point(layout.current, old)
    services.reload()
    services.enable()
    if services.start():
        wait_until_well(layout, old, str(read_note(old / STAMP)["version"]), was_ready=False, limit_s=limit_s)
    layout.upgrade.unlink()
    layout.previous.unlink()
    print_progress(f"{old.name} is in use again")
