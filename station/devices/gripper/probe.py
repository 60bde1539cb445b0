"""Gripper check of `station devices check`: nothing is moved."""

from station.devices.check_result import CheckResult
from station.devices.gripper.errors import GripperError, GripperFaultError
from station.devices.gripper.interface import GripperReading
from station.devices.gripper.robotiq import make_gripper
from station.settings.gripper import GripperCalibration, GripperSettings

_CALIBRATION_COUNTS = 3
"""Allowed reading beyond the calibrated ends."""


async def probe_gripper(settings: GripperSettings) -> list[CheckResult]:
    """Report what answers at the gripper's address and whether it can be used."""
    gripper = make_gripper(settings)
    place = gripper.link.place
    try:
        reading = await gripper.read()
    except GripperError as error:
        found = error.cause if place in error.cause else f"{place}: {error.cause}"
        return [CheckResult("gripper", found, "fault", error.remedy)]
    finally:
        await gripper.close()
    return [_judged(reading, place, settings.calibration)]


def _judged(reading: GripperReading, place: str, calibration: GripperCalibration) -> CheckResult:
    found = f"{place}: position {reading.position_count}, width {reading.width_mm:.1f} mm, {reading.object_state}"
    if reading.fault_code:
        fault = GripperFaultError(reading.fault_code)
        return CheckResult("gripper", f"{found}; {fault.cause}", "fault", fault.remedy)
    if not reading.active:
        return CheckResult(
            "gripper",
            f"{found}; not activated",
            "warning",
            "clear the fingers and activate it: they will travel their whole way",
        )
    low, high = calibration.open_count - _CALIBRATION_COUNTS, calibration.closed_count + _CALIBRATION_COUNTS
    if not low <= reading.position_count <= high:
        return CheckResult(
            "gripper",
            f"{found}; outside the calibrated counts {calibration.open_count} to {calibration.closed_count}",
            "warning",
            "read the counts with the gripper open and closed and correct gripper.calibration",
        )
    return CheckResult("gripper", found, "ok", "")
