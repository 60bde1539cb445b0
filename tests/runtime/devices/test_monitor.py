"""What a device's monitor reports: each change that means something else to the cycle, once."""

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.gripper.errors import GripperNotActiveError
from station.messages import device as messages
from station.messages.message import verbatim
from station.runtime.devices.monitor import DeviceMonitor


async def healthy() -> None:
    """A device with nothing wrong."""


def test_another_cause_is_reported_and_another_wording_of_the_same_is_not():
    reported = []
    monitor = DeviceMonitor("arm", messages.ARM(), healthy, 1.0, reported.append, lambda: None)
    stale, older, stopped = (
        ArmFault(cause, verbatim(detail))
        for cause, detail in ((ArmCause.STALE, "1 s"), (ArmCause.STALE, "2 s"), (ArmCause.PROTECTIVE_STOP, "stop"))
    )
    inactive = GripperNotActiveError(verbatim("not active"), verbatim("wait"))
    for fault in (stale, older, stopped, stopped, inactive, stale):
        monitor.report_fault(fault)
    assert reported == [stale, stopped, inactive, stale]
