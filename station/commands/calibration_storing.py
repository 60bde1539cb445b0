"""A calibration stored and audited in one step, for the commands."""

from pathlib import Path

from station.calibration.calibrating import Draft
from station.calibration.report import calibration_files
from station.calibration.store import CalibrationStore
from station.records.audit import append_audit
from station.records.database import records_folder
from station.records.direct import writing
from station.service.trail import calibration_stored
from station.settings.configuration import Configuration


def store_calibration(site: Configuration, operator: str, draft: Draft) -> Path:
    """Store a calibration and tell the audit trail, or neither where one of them cannot be written.

    Args:
        site: whose home it goes to.
        operator: who calibrated.
        draft: what was found.

    Raises:
        StationError: nothing was stored.
    """
    calibrations, new = CalibrationStore(site.home), draft.calibration
    before = calibrations.current(new.serial)
    with writing(records_folder(site.home)) as connection:
        old = None if before is None else before.id
        append_audit(connection, calibration_stored(operator, "", f"sensor {new.serial}", old, new.id))
        return calibrations.add_calibration(new, calibration_files(draft))
