"""Inspections of one process of the station: which run, which have their outcome, and who waits for it."""

from collections.abc import Callable

from station.channel.line import BeginReply, Outcome
from station.vocabulary import Reason

from .cell import LIMITS, Cell, Pending
from .inspection import Inspection, judged

RECORD_NO_RESULT_S = 1.0


class Inspections:
    """Inspections that began in this process."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self._clock, self._records = cell.clock, cell.records
        self._pending: Pending | None = None
        self._now: Inspection | None = None
        self._accepted: list[Inspection] = []
        self._waiting: dict[int, list[Callable[[Outcome], None]]] = {}

    @property
    def _inspection(self) -> Inspection:
        if self._now is None:
            raise RuntimeError("no inspection is under way")
        return self._now

    @property
    def _running(self) -> Inspection | None:
        return next((now for now in self._accepted if not now.standing), None)

    def _interrupt(self, reason: Reason) -> None:
        now = self._inspection
        if reason not in now.interruptions:
            now.interruptions.append(reason)
        now.outcome = "NO_RESULT"

    def _conclude(self, now: Inspection) -> None:
        record, press = self._records[now.sequence], now.press()
        verdict = now.verdict or judged(press)
        reasons = () if now.outcome == "PASS" else (now.interruptions or verdict.reasons or (Reason.INTERNAL_FAULT,))
        outcome = record.outcome(now.sequence, now.outcome, reasons, self._utc_ms())
        if (deciding := verdict.deciding) is not None:
            found = {"area_mm2": deciding.area_mm2, "area_px": deciding.area_px, "closing_mm": deciding.closing_mm}
            outcome = outcome.model_copy(update=found)
        record.press, record.fruits = press, now.fruits
        self._records.conclude(now.sequence, outcome)
        now.standing = True

    def _deliver(self, now: Inspection) -> None:
        standing = self._records[now.sequence].standing
        if now.standing and standing is not None:
            self._send_outcome(standing)

    def _send_outcome(self, outcome: Outcome) -> None:
        for answer in self._waiting.pop(outcome.sequence, ()):
            answer(outcome)

    def _take_on(self, pending: Pending) -> None:
        pending.now.accepted_s = self._clock.s
        self._accepted = [now for now in self._accepted if not now.standing]
        self._accepted.append(pending.now)
        deadline_s = LIMITS.inspection_s + RECORD_NO_RESULT_S
        pending.answer(BeginReply(sequence=pending.now.sequence, deadline_s=deadline_s))

    def _utc_ms(self) -> int:
        return round(1000 * self._clock.time())
