"""Uninstall."""

import shutil

from installer import site_files
from installer.layout import NAME, Layout, read_note
from installer.messages import print_progress
from installer.services import Services


def installed(layout: Layout) -> bool:
    """Return whether any part of an installation exists."""
    return layout.program.exists()


def uninstall(layout: Layout, services: Services, *, purge: bool) -> None:
    """Stop the station and remove all that the installer has put there. Idempotent.

    Args:
        purge: also remove configuration, records, backups and the user.
    """
    note = read_note(layout.manifest)
    if installed(layout) and note.get("files"):
        services.stop()
        services.disable()
        site_files.remove_files(layout)
        services.reload()
    shutil.rmtree(layout.cache, ignore_errors=True)
    if purge:
        services.remove_user()
        for folder in (layout.settings, layout.home, layout.backups):
            shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(layout.program, ignore_errors=True)
    site_files.remove_folders(layout, note.get("folders", []))
    if not purge:
        kept = [str(path) for path in (layout.settings, layout.home, layout.backups) if path.exists()]
        print_progress(
            f"kept: {', '.join([*kept, f'the user {NAME}']) if kept else 'nothing'}; --undo --purge removes them"
        )
