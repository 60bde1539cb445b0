"""Line state: what the PLC interface last reported of the line and of itself, with the alarms of it."""

import time

from station.channel.line import Line, RegisterView
from station.inspection.alarm_table import AlarmId
from station.messages import operation as messages
from station.messages.message import Message, joined
from station.runtime.alarms.manager import AlarmManager
from station.runtime.observability.metrics import Metrics

SILENT_S = 2.0
"""Time after which a PLC interface without a beat counts as silent, s: an estimate."""


class LineState:
    """State of the line by the PLC interface's beats."""

    def __init__(self, alarms: AlarmManager, metrics: Metrics) -> None:
        self._alarms, self._metrics = alarms, metrics
        self.registers_wanted = False
        """The PLC interface's registers are wanted with its next beat."""
        self.registers: tuple[tuple[RegisterView, ...], float] = ((), 0.0)
        """The PLC's registers as last reported, and their monotonic time; none and 0 before the first report."""
        self.last_report: Line | None = None
        """The PLC interface's last message; None if there was none."""
        self._at_s: float | None = None
        self._failed_rejects: list[Message] = []
        """Failed reject actuations as last reported, the oldest first."""

    @property
    def age_s(self) -> float | None:
        """Return the time since the PLC interface's last message; None if there was none."""
        return None if self._at_s is None else time.monotonic() - self._at_s

    def request_registers(self) -> None:
        """Request the PLC interface's registers with its next beat."""
        self.registers_wanted = True

    def report(self, line: Line) -> None:
        """Store the PLC interface's beat."""
        self.last_report, self._at_s = line, time.monotonic()
        if line.registers:
            self.registers, self.registers_wanted = (line.registers, time.monotonic()), False
        self._metrics.heard("plc_interface")
        self._metrics.waiting(line.waiting)
        # A PLC without a heartbeat is served too.
        if line.plc_alive or (line.plc_connected and not line.enable_withdrawn):
            self._metrics.heard("plc")

    def fault(self) -> Message | None:
        """Return the line's fault, as far as known."""
        age_s, report = self.age_s, self.last_report
        if report is None or age_s is None:
            return None
        if age_s > SILENT_S:
            return messages.INTERFACE_SILENT(age_s=age_s)
        if report.plc_alive or not report.enable_withdrawn:
            return None  # one that is enabled and has not beaten yet, or never beats, is served and not monitored
        return messages.HEARTBEAT_STILL() if report.plc_connected else messages.PLC_GONE()

    def update_alarms(self) -> None:
        """Raise and clear the alarms of the line's state."""
        age_s, report, alarms = self.age_s, self.last_report, self._alarms
        if report is None or age_s is None:
            return
        silent = age_s > SILENT_S
        alarms.update(AlarmId.PLC_INTERFACE_LOST, self.fault() if silent else None)
        alarms.update(AlarmId.PLC_HEARTBEAT_LOST, None if silent else self.fault())
        faults = {fault.part: fault.what for fault in reversed(report.faults)}
        self._update_reject_alarm([fault.what for fault in report.faults if fault.part == "reject"])
        alarms.update(AlarmId.CAN_NODE_LOST, faults.get("can"))
        alarms.update(AlarmId.PLC_JOURNAL_NOT_WRITABLE, faults.get("journal"))

    def _update_reject_alarm(self, failures: list[Message]) -> None:
        """Raise the alarm anew for each failed reject actuation: every one may have left a fruit among the good ones.

        The PLC interface reports a failure until the PLC's `clear_error`, also after a person has acknowledged it.
        """
        new = [failure for failure in failures if failure not in self._failed_rejects]
        self._failed_rejects = failures
        if new or not failures:
            self._alarms.clear(AlarmId.GATE_NOT_FIRED)
        if new:
            self._alarms.raise_(AlarmId.GATE_NOT_FIRED, joined(new))
