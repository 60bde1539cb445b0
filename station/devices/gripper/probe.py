"""Gripper check of `station devices check`: nothing is moved."""

from station.devices.check_result import CheckResult
from station.devices.gripper.errors import GripperError, GripperFaultError
from station.devices.gripper.interface import GripperReading
from station.devices.gripper.robotiq import make_gripper
from station.messages import gripper as messages
from station.messages.message import Message
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
        named = error.cause.parameters.get("place") == place
        found = error.cause if named else messages.CHECK_AT(place=place, trouble=error.cause)
        return [CheckResult("gripper", found, "fault", error.remedy)]
    finally:
        await gripper.close()
    return [_judged(reading, place, settings.calibration)]


def _judged(reading: GripperReading, place: Message, calibration: GripperCalibration) -> CheckResult:
    found = messages.CHECK_FOUND(
        place=place, count=reading.position_count, width_mm=reading.width_mm, state=reading.object_state.value
    )
    if reading.fault_code:
        fault = GripperFaultError(reading.fault_code)
        return CheckResult("gripper", messages.CHECK_TROUBLE(found=found, trouble=fault.cause), "fault", fault.remedy)
    if not reading.active:
        return CheckResult(
            "gripper",
            messages.CHECK_TROUBLE(found=found, trouble=messages.CHECK_NOT_ACTIVE()),
            "warning",
            messages.REMEDY_CLEAR_AND_ACTIVATE(),
        )
    low, high = calibration.open_count - _CALIBRATION_COUNTS, calibration.closed_count + _CALIBRATION_COUNTS
    if not low <= reading.position_count <= high:
        outside = messages.CHECK_UNCALIBRATED(open=calibration.open_count, closed=calibration.closed_count)
        return CheckResult(
            "gripper",
            messages.CHECK_TROUBLE(found=found, trouble=outside),
            "warning",
            messages.REMEDY_CALIBRATE(),
        )
    return CheckResult("gripper", found, "ok")
