"""Which alarms stand: raised and cleared by what is seen, remembered by the records, told to the PLC."""

import asyncio
import logging
import time

from station.devices.arm.faults import ArmCause, ArmFault
from station.devices.camera.interface import CameraError
from station.devices.gripper.errors import (
    GripperLinkLostError,
    GripperProtocolError,
    GripperSilentError,
    GripperTimeoutError,
    GripperUnreachableError,
)
from station.errors import StationError
from station.inspection.alarm_table import ALARMS, AlarmId
from station.inspection.alarms import Alarm, Alarms, AlarmState
from station.records.errors import RecordsError
from station.records.model import AlarmEntry, AlarmRow
from station.records.records import Records
from station.service.crew import ARM, CAMERA, GRIPPER
from station.service.inspection import utc_ms
from station.service.metrics import Metrics

log = logging.getLogger(__name__)

OF_DEVICE: dict[str, frozenset[AlarmId]] = {
    ARM: frozenset(
        {
            AlarmId.EMERGENCY_STOP,
            AlarmId.PROTECTIVE_STOP,
            AlarmId.SAFETY_FAULT,
            AlarmId.ARM_LINK_LOST,
            AlarmId.ARM_NOT_REMOTE,
        }
    ),
    GRIPPER: frozenset({AlarmId.GRIPPER_LINK_LOST, AlarmId.GRIPPER_FAULT, AlarmId.GRIPPER_JAM}),
    CAMERA: frozenset({AlarmId.CAMERA_LOST, AlarmId.CAMERA_STALE}),
}
"""What can be told of a device; all of it is cleared once the device is well."""

_CAUSE_THERE = {AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED, AlarmState.SHELVED}
_MOST_UNSAVED = 1000
_ARM = {
    ArmCause.EMERGENCY_STOP: AlarmId.EMERGENCY_STOP,
    ArmCause.PROTECTIVE_STOP: AlarmId.PROTECTIVE_STOP,
    ArmCause.SAFETY_FAULT: AlarmId.SAFETY_FAULT,
    ArmCause.LOCAL_CONTROL: AlarmId.ARM_NOT_REMOTE,
}
_GRIPPER_LINK = (GripperUnreachableError, GripperLinkLostError, GripperSilentError, GripperProtocolError)


def alarm_of(device: str, fault: StationError) -> AlarmId:
    """The alarm that a device's fault is told by.

    Args:
        device: `arm`, `gripper` or `camera`.
        fault: what is wrong with it.
    """
    match fault:
        case ArmFault():
            return _ARM.get(fault.cause, AlarmId.ARM_LINK_LOST)
        case GripperTimeoutError():
            return AlarmId.GRIPPER_JAM
        case _ if isinstance(fault, _GRIPPER_LINK):
            return AlarmId.GRIPPER_LINK_LOST
        case CameraError():
            return AlarmId.CAMERA_LOST
    return {ARM: AlarmId.ARM_LINK_LOST, GRIPPER: AlarmId.GRIPPER_FAULT, CAMERA: AlarmId.CAMERA_STALE}[device]


class AlarmDesk:
    """The station's alarms. Every verb is immediate; `keep` makes them durable afterwards.

    Args:
        metrics: shows which are active.
    """

    def __init__(self, metrics: Metrics) -> None:
        self._alarms = Alarms()
        self._metrics = metrics
        self._present: set[AlarmId] = set()
        self._unsaved: list[AlarmEntry] = []
        self._changed = asyncio.Event()

    @property
    def alarms(self) -> Alarms:
        """All of them, as a value."""
        return self._alarms

    def raise_(self, alarm: AlarmId, detail: str) -> None:
        """Its cause is there; told once for as long as it is.

        Args:
            alarm: which.
            detail: what was seen.
        """
        if alarm not in self._present:
            self._present.add(alarm)
            self._set(self._alarms.raise_(alarm, time.time(), detail), alarm, "raised", detail)

    def clear(self, alarm: AlarmId) -> None:
        """Its cause is gone.

        Args:
            alarm: which; one whose cause was not there is left alone.
        """
        if alarm in self._present:
            self._present.discard(alarm)
            self._set(self._alarms.returned(alarm, time.time()), alarm, "cleared", "")

    def show(self, alarm: AlarmId, detail: str) -> None:
        """Raise it where there is something to say, clear it where not.

        Args:
            alarm: which.
            detail: what was seen; empty where its cause is gone.
        """
        if detail:
            self.raise_(alarm, detail)
        else:
            self.clear(alarm)

    def device(self, device: str, fault: StationError | None) -> None:
        """Tell what is wrong with a device, or that it is well.

        Args:
            device: `arm`, `gripper` or `camera`.
            fault: None where nothing is.
        """
        told = None if fault is None else alarm_of(device, fault)
        for alarm in OF_DEVICE[device]:
            self.show(alarm, str(fault) if alarm is told else "")

    def acknowledge_gone(self) -> int:
        """Acknowledge, and let go where latched, every alarm whose cause is gone.

        Returns:
            How many are still active.
        """
        now_s = time.time()
        for alarm in set(self._alarms.known) - self._present:
            self._set(self._alarms.acknowledge(alarm, now_s).reset(alarm, now_s), alarm, "acknowledged", "")
        return len(self._alarms.active())

    def tick(self) -> None:
        """Let time end what it ends; about once a second."""
        later = self._alarms.tick(time.time())
        if later != self._alarms:
            self._alarms = later
            self._show()

    async def recall(self, records: Records) -> None:
        """Take up the alarms of the start before; their causes are there until the contrary is seen.

        Args:
            records: as opened.
        """
        known = {}
        for row in await records.load_alarms():
            if row.id in ALARMS and row.state in set(AlarmState):
                alarm, state = AlarmId(row.id), AlarmState(row.state)
                until_s = None if row.shelved_until_utc_ms is None else row.shelved_until_utc_ms / 1000
                since_s, last_s = row.raised_utc_ms / 1000, row.changed_utc_ms / 1000
                known[alarm] = Alarm(alarm, state, row.detail, since_s, 1, last_s, until_s)
                if state in _CAUSE_THERE:
                    self._present.add(alarm)
        self._alarms = Alarms(known)
        self._show()

    async def keep(self, records: Records) -> None:
        """Make every change durable, until cancelled; what could not be written is tried again with the next.

        Args:
            records: as opened.
        """
        while True:
            await self._changed.wait()
            self._changed.clear()
            entries = tuple(self._unsaved)
            rows = tuple(
                AlarmRow(
                    alarm.id,
                    alarm.state,
                    round(1000 * alarm.since_s),
                    round(1000 * alarm.last_raised_s),
                    alarm.detail,
                    None if alarm.shelved_until_s is None else round(1000 * alarm.shelved_until_s),
                )
                for alarm in self._alarms.known.values()
            )
            try:
                await records.save_alarms(rows, entries)
            except RecordsError as error:
                log.warning("alarms are not remembered: %s", error)
            else:
                del self._unsaved[: len(entries)]

    def _set(self, alarms: Alarms, alarm: AlarmId, change: str, detail: str) -> None:
        if alarms == self._alarms:
            return
        self._alarms = alarms
        self._unsaved = [*self._unsaved, AlarmEntry(utc_ms(), alarm, change, detail)][-_MOST_UNSAVED:]
        level = logging.WARNING if change == "raised" else logging.INFO
        log.log(level, "alarm %s %s%s", alarm, change, f": {detail}" if detail else "")
        self._show()

    def _show(self) -> None:
        self._metrics.alarms((alarm.id, ALARMS[alarm.id].priority) for alarm in self._alarms.active())
        self._changed.set()
