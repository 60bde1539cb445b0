"""Records as a value in memory, with the rules of the station's: the first published outcome remains."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from station.channel.line import Open, Outcome
from station.inspection.press import Press
from station.vocabulary import OutcomeName, Reason


@dataclass(slots=True)
class Record:
    """One inspection, durable since its trigger."""

    trigger_id: int
    encoder: int
    lot: str
    recipe: tuple[int, int]
    """Number and checksum."""
    began_utc_ms: int
    judged: OutcomeName | None = None
    standing: Outcome | None = None
    published: bool = False
    acknowledged: bool = False
    press: Press | None = None
    """What was judged; for the laws."""
    fruits: set[int] = field(default_factory=set)
    """Of which the press's images were taken; for the laws."""

    def outcome(self, sequence: int, name: OutcomeName, reasons: Iterable[Reason], ended_utc_ms: int) -> Outcome:
        """Make an outcome of it; what was measured is the caller's to add."""
        return Outcome(
            sequence=sequence,
            trigger_id=self.trigger_id,
            outcome=name,
            reasons=tuple(reasons),
            late=Reason.LATE in reasons,
            partial=name != "PASS",
            simulated=True,
            area_mm2=None,
            area_px=None,
            closing_mm=None,
            confidence=None,
            recipe_number=self.recipe[0],
            recipe_checksum=self.recipe[1],
            began_utc_ms=self.began_utc_ms,
            ended_utc_ms=ended_utc_ms,
            duration_ms=0,
            encoder=self.encoder,
            lot=self.lot,
        )


class MemoryRecords(dict[int, Record]):
    """Records by sequence. They survive the station."""

    def begin(self, record: Record) -> int:
        """Make a trigger durable."""
        sequence = max(self, default=0) + 1
        self[sequence] = record
        return sequence

    def conclude(self, sequence: int, outcome: Outcome) -> Outcome:
        """Store an outcome, unless there is one; return the one in force."""
        record = self[sequence]
        record.judged = record.judged or outcome.outcome
        record.standing = record.standing or outcome
        return record.standing

    def publish(self, outcome: Outcome) -> bool:
        """Note what the PLC was given; whether it is the first time."""
        record = self[outcome.sequence]
        first, record.published = not record.published, True
        if first:
            record.standing = outcome
        return first

    def acknowledge(self, sequence: int) -> None:
        """Note that the PLC has taken every published outcome up to a sequence."""
        for number, record in self._open():
            record.acknowledged = record.acknowledged or (record.published and number <= sequence)

    def end_open(self, utc_ms: int) -> None:
        """End what an earlier start left open: what ran, or was never published, is NO_RESULT."""
        for number, record in self._open():
            if not record.published:
                record.standing = record.outcome(number, "NO_RESULT", (Reason.STATION_LOST,), utc_ms)

    def open(self, running: tuple[int, int] | None) -> Open:
        """Return what began and was not acknowledged."""
        ended = tuple(record.standing for _, record in self._open() if record.standing is not None)
        return Open(running=running, outcomes=ended)

    def _open(self) -> list[tuple[int, Record]]:
        """Return the last ones that are not acknowledged; older than a hundred none is."""
        last = max(self, default=0)
        recent = range(max(1, last - 100), last + 1)
        return [(number, self[number]) for number in recent if not self[number].acknowledged]
