"""Calibration storage for the commands: a calibration or verification and its audit entry in one step."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from station.calibration.calibration_procedure import Draft
from station.calibration.model import Calibration
from station.calibration.report import calibration_files, verification_files
from station.calibration.store import CalibrationStore, Prepared
from station.calibration.verification_procedure import VerificationResult
from station.records.audit import AuditEntry, append_audit
from station.records.database import records_folder
from station.records.direct_transaction import direct_transaction
from station.runtime.observability.audit_logger import calibration_entry, verification_entry
from station.settings.configuration import Configuration


def store_calibration(site: Configuration, operator: str, draft: Draft) -> Path:
    """Store a calibration and its audit entry, or neither if one of them cannot be written.

    Raises:
        StationError: nothing was stored.
    """
    calibrations, new = CalibrationStore(site.home), draft.calibration
    before = calibrations.current(new.serial)
    entry = calibration_entry(operator, "", f"sensor {new.serial}", None if before is None else before.id, new.id)
    return _put_in_force(site, entry, calibrations.prepare_calibration(new, calibration_files(draft)))


def store_verification(
    site: Configuration, operator: str, verified: VerificationResult, calibration: Calibration
) -> Path:
    """Store a verification and its audit entry, as `store_calibration`."""
    new, files = verified.verification, verification_files(verified, calibration)
    entry = verification_entry(operator, f"sensor {new.serial}", calibration.id, new.id, passed=new.passed)
    return _put_in_force(site, entry, CalibrationStore(site.home).prepare_verification(new, files))


def _put_in_force(site: Configuration, entry: AuditEntry, prepared: Prepared) -> Path:
    """Put a record in force together with its audit entry; once started it completes, also after Ctrl-C."""

    def store() -> Path:
        try:
            with direct_transaction(records_folder(site.home)) as connection:
                append_audit(connection, entry)
                return prepared.put_in_force()
        except BaseException:  # also after it was put in force, where the commit fails
            prepared.discard()
            raise

    # Ctrl-C interrupts the main thread only: after the commit it would discard what the audit trail has.
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(store).result()
