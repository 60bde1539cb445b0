"""Station on the simulated clock: the real cycle's table, deadlines, judge, stop criteria and alarm manager.

A plain interpreter of the cycle's actions replaces the runner and the service, which wait by asyncio.
"""

from collections.abc import Callable
from typing import Any

from station.channel.line import BeginReply, Outcome, StationState
from station.inspection.alarm_table import AlarmId
from station.inspection.cycle import UNJUDGED, Event
from station.inspection.states import STATES
from station.runtime.alarms.outcome_monitor import OutcomeMonitor
from station.runtime.cycle.runner import event_of
from station.vocabulary import Refusal

from .actions import Actions
from .cell import Cell, Pending
from .inspection import RECIPE, Inspection
from .interpreter import WORDS
from .records import Record

_MONITOR_S = 0.1
_NUMBER = (RECIPE.plc_number, 77)


class Station(Actions):
    """One process of the station, from its start to its kill."""

    def __init__(self, cell: Cell, boot: int) -> None:
        super().__init__(cell)
        self.boot = boot
        self._outcomes = OutcomeMonitor(self.alarms)
        self._seen_faults: set[str] = set()
        self._records.end_open(self._utc_ms())
        self._act(self.cycle.begin.actions, cell.hold or Event.RESET)
        self._entered(self.cycle.state)
        self._monitor()

    def kill(self) -> None:
        """End the process: what it does not have on the disk is lost, and the devices stop."""
        self.alive = False

    def report(self) -> StationState:
        """Answer a beat."""
        alarms = self.alarms.alarms
        return StationState(
            boot=f"boot {self.boot}",
            healthy=True,
            ready=STATES[self.state].refusal is None,
            why_not_ready=None,
            packml_state=STATES[self.state].packml,
            mode=1,
            recipe_number=_NUMBER[0],
            recipe_checksum=_NUMBER[1],
            error_code=alarms.error_code,
            alarms=alarms.word,
            simulated=True,
        )

    def begin(self, trigger_id: int, encoder: int, lot: str, answer: Callable[[BeginReply], None]) -> None:
        """Begin an inspection or refuse it; an equal request is another fruit's."""
        if (refusal := STATES[self.state].refusal) is not None or self._pending is not None:
            answer(BeginReply(refusal=refusal or Refusal.BUSY))
        else:
            record = Record(trigger_id, encoder, lot, _NUMBER, self._utc_ms())
            self._pending = Pending(record, answer, Inspection())
            self.post(Event.TRIGGER)

    def await_outcome(self, sequence: int, answer: Callable[[Outcome], None]) -> bool:
        """Answer once there is an outcome; False where the inspection is unknown."""
        record = self._records.get(sequence)
        if record is None:
            return False
        known = any(now.sequence == sequence and not now.standing for now in self._accepted)
        if record.standing is not None and not known:
            answer(record.standing)
        else:
            self._waiting.setdefault(sequence, []).append(answer)
        return True

    def published(self, outcome: Outcome) -> bool:
        """Note what the PLC was given; False where the disk refuses."""
        if self.cell.devices.trouble("disk") == "full":
            return False
        if self._records.publish(outcome):
            self._outcomes.add(outcome)
        self._send_outcome(outcome)
        if (running := self._running) is not None and running.sequence == outcome.sequence and self.state in UNJUDGED:
            self.post(Event.CALLED_OFF)
        return True

    def acknowledged(self, sequence: int) -> bool:
        """Note what the PLC has taken; False where the disk refuses."""
        if self.cell.devices.trouble("disk") == "full":
            return False
        self._records.acknowledge(sequence)
        return True

    def open(self) -> Any:
        """Return what began and was not acknowledged."""
        running = self._running
        return self._records.open(
            None if running is None else (running.sequence, self._records[running.sequence].trigger_id)
        )

    def _monitor(self) -> None:
        """See what the devices' monitors see, and report a change."""
        for part in ("arm", "gripper", "camera"):
            fault = self.cell.devices.standing(part)
            news = fault is not None and part not in self._seen_faults
            (self._seen_faults.add if fault is not None else self._seen_faults.discard)(part)
            self.alarms.set_device_fault(part, fault)
            if news and fault is not None:
                self.post(event_of(fault))
        full = self.cell.devices.trouble("disk") == "full"
        self.alarms.update(AlarmId.RECORDS_NOT_WRITABLE, None if self._records_fault is None else WORDS)
        self.alarms.update(AlarmId.DISK_LOW, WORDS if full else None)
        jumps = self.cell.devices.trouble("clock")
        self.alarms.update(AlarmId.CLOCK_STEPPED, None if jumps is None else WORDS)
        self.alarms.tick()
        self._after(_MONITOR_S, self._monitor)
