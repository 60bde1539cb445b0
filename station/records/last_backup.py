"""Last backup: when the timer or the installer made the last complete one of records, state and configuration."""

from pathlib import Path

FILE_NAME = "last_backup"
"""In the home folder; `deploy/installer/backup.py` touches it."""


def last_backup_utc_s(home: Path) -> float:
    """Return the time of the last complete backup, seconds since 1970; 0 before the first."""
    try:
        return (home / FILE_NAME).stat().st_mtime
    except OSError:
        return 0.0
