"""Alarm manager: raises and clears alarms, stores them in the records, and reports them to the PLC."""

import asyncio
import logging
import time
from collections.abc import Callable, Collection, Iterable

from station.clock import utc_ms
from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import FrameFault
from station.devices.gripper.errors import (
    LINK_ERRORS,
    GripperEmergencyStopError,
    GripperTimeoutError,
)
from station.errors import StationError
from station.inspection.alarm_table import ALARMS, AlarmId
from station.inspection.alarms import CAUSED, Alarms
from station.messages import alarm_commands as messages
from station.messages.message import Message, message_in, message_of, text_of
from station.messages.records import FAULT
from station.records.errors import RecordsError
from station.records.model import AlarmEntry, StoredAlarm
from station.records.open import Notice
from station.records.records import Records
from station.runtime.devices.manager import ARM, CAMERA, GRIPPER
from station.runtime.devices.monitor import DeviceMonitor
from station.runtime.devices.rig import FramesError
from station.runtime.observability.metrics import Metrics

log = logging.getLogger(__name__)

OF_DEVICE: dict[str, frozenset[AlarmId]] = {
    ARM: frozenset(
        {
            AlarmId.EMERGENCY_STOP,
            AlarmId.PROTECTIVE_STOP,
            AlarmId.SAFETY_FAULT,
            AlarmId.ARM_LINK_LOST,
            AlarmId.ARM_NOT_REMOTE,
            AlarmId.ARM_NOT_READY,
        }
    ),
    GRIPPER: frozenset({AlarmId.EMERGENCY_STOP, AlarmId.GRIPPER_LINK_LOST, AlarmId.GRIPPER_FAULT, AlarmId.GRIPPER_JAM}),
    CAMERA: frozenset({AlarmId.CAMERA_LOST, AlarmId.CAMERA_STALE}),
}
"""Alarms that only the device monitors raise; all are cleared once each of their devices is healthy."""

_OF_THE_PAST = {AlarmId.RECORDS_LOST, AlarmId.GATE_NOT_FIRED}
"""Alarms of what has happened once, which no check finds undone: a person's acknowledgement ends them."""
_MOST_UNSAVED = 1000
"""Maximum number of changes that wait for records that cannot be written; the oldest is dropped. An estimate."""
_ARM = {
    ArmCause.EMERGENCY_STOP: AlarmId.EMERGENCY_STOP,
    ArmCause.PROTECTIVE_STOP: AlarmId.PROTECTIVE_STOP,
    ArmCause.SAFETY_FAULT: AlarmId.SAFETY_FAULT,
    ArmCause.LOCAL_CONTROL: AlarmId.ARM_NOT_REMOTE,
    ArmCause.PROGRAM_STOPPED: AlarmId.ARM_NOT_REMOTE,
    ArmCause.REGISTERS_IN_USE: AlarmId.ARM_NOT_REMOTE,
    ArmCause.LINK_LOST: AlarmId.ARM_LINK_LOST,
    ArmCause.STALE: AlarmId.ARM_LINK_LOST,
    ArmCause.DEADLINE: AlarmId.ARM_LINK_LOST,
    ArmCause.CLOSED: AlarmId.ARM_LINK_LOST,
}
"""All other causes are of an arm that answers."""
_FRAMES = (
    (frozenset({FrameFault.WRONG_SIZE}), AlarmId.CAMERA_LOST),
    (frozenset({FrameFault.STALE, FrameFault.REPEATED}), AlarmId.CAMERA_STALE),
    (frozenset(FrameFault), AlarmId.CAMERA_SATURATED),
)
"""The alarm of bad frames, by the first of these that any of them had."""


def alarm_of(device: str, fault: StationError) -> AlarmId:
    """Return the alarm that reports a fault of the `arm`, `gripper` or `camera`."""
    match fault:
        case FramesError():
            return next((alarm for faults, alarm in _FRAMES if fault.faults & faults), AlarmId.CAMERA_STALE)
        case ArmFault():
            return _ARM.get(fault.cause, AlarmId.ARM_NOT_READY)
        case GripperEmergencyStopError():
            return AlarmId.EMERGENCY_STOP
        case GripperTimeoutError():
            return AlarmId.GRIPPER_JAM
        case _ if isinstance(fault, LINK_ERRORS):
            return AlarmId.GRIPPER_LINK_LOST
    return {ARM: AlarmId.ARM_LINK_LOST, GRIPPER: AlarmId.GRIPPER_FAULT, CAMERA: AlarmId.CAMERA_LOST}[device]


class AlarmManager:
    """Alarm states of the station. Every method is immediate; `store_changes` makes the changes durable afterwards."""

    def __init__(self, metrics: Metrics, *, to_restore: bool = False) -> None:
        """Begin without alarms.

        Args:
            metrics: count the active ones.
            to_restore: store nothing before `restore` has succeeded, which would replace the previous start's alarms.
        """
        self.alarms = Alarms()
        """All alarms, as a value."""
        self._stopped_on_pendant: Callable[[], bool] = lambda: False
        self._metrics = metrics
        self._present: set[AlarmId] = set()
        self._to_restore = to_restore
        self._device_alarms: dict[str, AlarmId | None] = {}
        """Last alarm of each device's monitor; a reference may raise the same one of a camera."""
        self._watched: tuple[str, ...] = ()
        """The station's devices."""
        self._unsaved: list[AlarmEntry] = []
        self._changed = asyncio.Event()

    def raise_(self, alarm: AlarmId, detail: Message | None) -> None:
        """Raise an alarm; it is published once for as long as its cause is present."""
        if alarm not in self._present:
            self._present.add(alarm)
            self._set(self.alarms.raise_(alarm, time.time(), detail), alarm, "raised", detail)

    def clear(self, alarm: AlarmId) -> None:
        """Mark an alarm's cause as gone; an alarm whose cause was not present does not change."""
        if alarm in self._present:
            self._present.discard(alarm)
            self._set(self.alarms.returned(alarm, time.time()), alarm, "cleared")

    def update(self, alarm: AlarmId, detail: Message | None) -> None:
        """Raise the alarm with the finding, or clear it if there is none: the cause is gone.

        A later finding takes the place of the one before, as the alarm's detail; the alarms' history keeps the first.
        """
        if detail is None:
            self.clear(alarm)
        elif alarm in self._present:
            self.alarms = self.alarms.raise_(alarm, time.time(), detail)
        else:
            self.raise_(alarm, detail)

    def report_lost_records(self, notices: Iterable[Notice]) -> None:
        """Raise the alarm of lost records by the notices of their opening; it stays until it is acknowledged."""
        for notice in notices:
            self.update(AlarmId.RECORDS_LOST, FAULT(cause=notice.cause, remedy=notice.remedy))

    def update_device(self, monitor: DeviceMonitor) -> None:
        """Raise or clear a device's alarms by what its monitor found; they stay as they are until that is decided."""
        if monitor.is_decided:
            self.set_device_fault(monitor.name, monitor.fault)

    def clear_absent(self, devices: Collection[str]) -> None:
        """Clear the alarms that none of a station's devices raises: of an arm that was configured away."""
        self._watched = tuple(devices)
        watched = {alarm for device in devices for alarm in OF_DEVICE[device]}
        for alarms in OF_DEVICE.values():
            for alarm in alarms - watched:
                self.clear(alarm)

    def keep_pendant_alarm(self, stopped_on_pendant: Callable[[], bool]) -> None:
        """Keep the alarm of a stop on the pendant while the cycle is stopped by it, also once the arm is healthy."""
        self._stopped_on_pendant = stopped_on_pendant

    def set_device_fault(self, device: str, fault: StationError | None) -> None:
        """Raise the alarm of the fault of the `arm`, `gripper` or `camera`, or clear the alarms of a healthy one."""
        alarm = None if fault is None else alarm_of(device, fault)
        before, self._device_alarms[device] = self._device_alarms.get(device), alarm
        # A device whose monitor has not decided yet may have the cause of an alarm that it shares with this one.
        kept = {other for name in self._watched if name not in self._device_alarms for other in OF_DEVICE[name]}
        if self._stopped_on_pendant():
            kept.add(AlarmId.ARM_NOT_REMOTE)
        for other in OF_DEVICE[device] | ({before} if before is not None else set()):
            if other not in self._device_alarms.values() and other not in kept:
                self.clear(other)
        if alarm is not None and fault is not None:
            self.update(alarm, message_of(fault))

    def acknowledge(self, alarm: AlarmId) -> bool:
        """Acknowledge an alarm, and return whether that changed anything."""
        changed = self._set(self.alarms.acknowledge(alarm), alarm, "acknowledged")
        if changed and alarm in _OF_THE_PAST and self.alarms.get(alarm).state in CAUSED:
            self._present.discard(alarm)
            self._set(self.alarms.end(alarm), alarm, "cleared")
        return changed

    def shelve(self, alarm: AlarmId, for_s: float, by: str, reason: str) -> bool:
        """Shelve an alarm for `LONGEST_SHELVED_S` at most, and return whether that changed anything.

        A latched alarm, and one that is shelved already, does not change.
        """
        detail = messages.SHELVED(duration_s=for_s, who=by, reason=reason)
        return self._set(self.alarms.shelve(alarm, time.time(), for_s, by), alarm, "shelved", detail)

    def unshelve(self, alarm: AlarmId) -> bool:
        """Unshelve an alarm, and return whether that changed anything; a present cause has to be acknowledged again."""
        return self._set(self.alarms.unshelve(alarm), alarm, "unshelved")

    def acknowledge_returned(self) -> None:
        """Acknowledge every alarm that has returned to normal: the PLC's command."""
        self._set_all(self.alarms.acknowledge_returned(), "acknowledged")

    def reset(self) -> None:
        """Unlatch every latched alarm whose cause is gone, after a person's reset."""
        alarms = self.alarms
        for alarm in self.alarms.known:
            alarms = alarms.reset(alarm)
        self._set_all(alarms, "reset")

    def tick(self) -> None:
        """Apply what depends on time, as the end of shelving; call it about once a second."""
        later = self.alarms.tick(time.time())
        if later != self.alarms:
            self.alarms = later
            self._publish_active()

    async def restore(self, records: Records) -> None:
        """Restore the alarms of the previous start but those that are known by now, and raise that of lost records.

        Their causes count as present until a check clears them.
        """
        stored = Alarms.restored(
            {
                "id": row.id,
                "state": row.state,
                "detail": message_in(row.detail),
                "since_s": row.raised_utc_ms / 1000,
                "raised": 1,
                "shelved_until_s": None if row.shelved_until_utc_ms is None else row.shelved_until_utc_ms / 1000,
                "shelved_by": row.shelved_by,
            }
            for row in await records.load_alarms()
        )
        former = {alarm.id: alarm for alarm in stored.known.values() if alarm.id not in self.alarms.known}
        self.alarms = Alarms({**former, **self.alarms.known})
        self._present |= {alarm.id for alarm in former.values() if alarm.state in CAUSED}
        self._to_restore = False
        self._publish_active()
        self.report_lost_records(records.notices)

    async def store_changes(self, records: Records) -> None:
        """Store every change until cancelled; a change that could not be stored is tried again with the next one."""
        while True:
            await self._changed.wait()
            self._changed.clear()
            if self._to_restore:
                continue
            entries, self._unsaved = tuple(self._unsaved), []
            rows = tuple(
                StoredAlarm(
                    alarm.id,
                    alarm.state,
                    round(1000 * alarm.since_s),
                    utc_ms(),
                    text_of(alarm.detail),
                    None if alarm.shelved_until_s is None else round(1000 * alarm.shelved_until_s),
                    alarm.shelved_by,
                )
                for alarm in self.alarms.known.values()
            )
            try:
                await records.save_alarms(rows, entries)
            except RecordsError as error:
                log.warning("alarms are not remembered: %s", error)
                self._unsaved = [*entries, *self._unsaved][-_MOST_UNSAVED:]
                continue
            if any(entry.id == AlarmId.RECORDS_LOST for entry in entries):
                await records.forget_notices()

    def _set(self, alarms: Alarms, alarm: AlarmId, change: str, detail: Message | None = None) -> bool:
        if alarms.get(alarm) == self.alarms.get(alarm):
            return False
        self.alarms = alarms
        self._unsaved = [*self._unsaved, AlarmEntry(utc_ms(), alarm, change, text_of(detail))][-_MOST_UNSAVED:]
        level = logging.WARNING if change == "raised" else logging.INFO
        if detail is None:
            log.log(level, "alarm %s %s", alarm, change)
        else:
            log.log(level, "alarm %s %s: %s", alarm, change, detail)
        self._publish_active()
        return True

    def _set_all(self, alarms: Alarms, change: str) -> None:
        for alarm, before in self.alarms.known.items():
            if alarms.get(alarm) != before:
                self._unsaved = [*self._unsaved, AlarmEntry(utc_ms(), alarm, change)][-_MOST_UNSAVED:]
        self.alarms = alarms
        self._publish_active()

    def _publish_active(self) -> None:
        self._metrics.alarms((alarm.id, ALARMS[alarm.id].priority) for alarm in self.alarms.active)
        self._changed.set()
