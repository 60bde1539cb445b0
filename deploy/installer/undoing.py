"""Take the installation away again."""

import shutil

from installer import site_files
from installer.layout import NAME, Layout, read_note
from installer.services import Services
from installer.words import say


def installed(layout: Layout) -> bool:
    """Whether there is anything of an installation.

    Args:
        layout: where.
    """
    return layout.program.exists()


def undo(layout: Layout, services: Services, *, purge: bool) -> None:
    """Stop the station and take away all that the installer has put there. Doing so again changes nothing.

    Args:
        layout: where.
        services: of the system there.
        purge: take away configuration, records, copies and the user as well; they are kept otherwise.
    """
    note = read_note(layout.manifest)
    if installed(layout) and note.get("files"):
        services.stop()
        services.disable()
        site_files.take_away(layout)
        services.reload()
    shutil.rmtree(layout.cache, ignore_errors=True)
    if purge:
        services.remove_user()
        for folder in (layout.settings, layout.home, layout.backups):
            shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(layout.program, ignore_errors=True)
    site_files.take_away_folders(layout, note.get("folders", []))
    if not purge:
        kept = [str(path) for path in (layout.settings, layout.home, layout.backups) if path.exists()]
        say(f"kept: {', '.join([*kept, f'the user {NAME}']) if kept else 'nothing'}; --undo --purge removes them")
