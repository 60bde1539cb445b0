"""Change of the sensor's gel: what measures by the earlier gel goes out of force, with an audit entry."""

from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import Connection

from station.calibration.model import GelChange
from station.calibration.store import CalibrationStore
from station.records.audit import AuditEntry, append_audit
from station.runtime.imaging.golden_reference import GOLDEN


def store_gel_change(connection: Connection, home: Path, serial: str, who: str, role: str) -> str | None:
    """Take a sensor's calibrations out of force, and remove the golden reference that is no calibration's.

    Args:
        connection: of a transaction on the records.

    Returns:
        The calibration that was in force, by its id; None if there was none.

    Raises:
        CalibrationError: it could not be stored; the calibration in force may still be.
        OSError: the golden reference could not be removed; likewise.
    """
    store = CalibrationStore(home)
    before = store.current(serial)
    old = None if before is None else before.id
    append_audit(connection, AuditEntry(who, role, "calibration.gel_changed", f"sensor {serial}", "", old))
    (home / GOLDEN).unlink(missing_ok=True)  # first: nothing uses it while a calibration is in force
    store.mark_gel_changed(serial, GelChange(operator=who, changed_at=datetime.now(UTC)))
    return old
