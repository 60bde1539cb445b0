"""Calibration storage for the commands: the calibration and its audit entry in one step."""

from pathlib import Path

from station.calibration.calibration_procedure import Draft
from station.calibration.report import calibration_files
from station.calibration.store import CalibrationStore
from station.records.audit import append_audit
from station.records.database import records_folder
from station.records.direct_transaction import direct_transaction
from station.runtime.observability.audit_logger import calibration_entry
from station.settings.configuration import Configuration


def store_calibration(site: Configuration, operator: str, draft: Draft) -> Path:
    """Store a calibration and its audit entry, or neither if one of them cannot be written.

    Raises:
        StationError: nothing was stored.
    """
    calibrations, new = CalibrationStore(site.home), draft.calibration
    before = calibrations.current(new.serial)
    with direct_transaction(records_folder(site.home)) as connection:
        old = None if before is None else before.id
        append_audit(connection, calibration_entry(operator, "", f"sensor {new.serial}", old, new.id))
        return calibrations.add_calibration(new, calibration_files(draft))
