"""Laws of a story over the wire: what the line's PLC read, beside the records and the twin's truth."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from sqlalchemy import select

from plc_interface.plc_simulator.program import Decision, Passage
from station.inspection.evidence import AT_MM
from station.records.database import reading
from station.records.model import FullRecord
from station.records.queries import read_inspection
from station.records.schema import inspections

from .link_observer import Observer
from .link_results import NONE_DOUBLED, NONE_STALE, ONE_OUTCOME, WHOLE_PRESS
from .rig import Rig

Broken = tuple[str, str]


def records_since(rig: Rig, sequence: int) -> list[FullRecord]:
    """Return the records after a sequence, oldest first."""
    folder: Path = rig.records
    with reading(folder) as connection:
        number = inspections.c.sequence
        later = connection.execute(select(number).where(number > sequence).order_by(number)).scalars().all()
        return [read_inspection(connection, each, folder) for each in later]


def of_records(records: Sequence[FullRecord], observer: Observer, deciding_mm: float) -> Iterator[Broken]:
    """Check the inspections of one fruit's time: the station's own view, and what the interface showed.

    Args:
        records: of that time.
        observer: with all that was shown.
        deciding_mm: closing of the first limit that decides by itself.
    """
    # A trigger whose begin the interface missed was not accepted: the station closes it as NO_RESULT, which no PLC is
    # shown, and the PLC triggers again.
    ids = [record.trigger.trigger_id for record in records if not _withdrawn(record, observer)]
    for trigger_id in {each for each in ids if ids.count(each) > 1}:
        yield ONE_OUTCOME, f"trigger {trigger_id} was inspected {ids.count(trigger_id)} times"
    for record in records:
        where, standing = f"sequence {record.sequence}", record.standing
        if standing is None or record.acknowledged_utc_ms is None:
            yield ONE_OUTCOME, f"{where} has no outcome, or none that was acknowledged"
            continue
        shown = observer.shown.get(record.sequence, set())
        if len(shown) > 1:
            yield NONE_DOUBLED, f"{where} changed while it was shown: {sorted(map(str, shown))}"
        for trigger_id, outcome, _, _ in shown:
            if trigger_id != record.trigger.trigger_id:
                yield NONE_STALE, f"{where} was shown with trigger {trigger_id}, and is of {record.trigger.trigger_id}"
            if outcome != standing.outcome:
                yield ONE_OUTCOME, f"{where} was shown as {outcome}, and is {standing.outcome}"
        if standing.outcome == "PASS" and not _whole(record, deciding_mm):
            yield WHOLE_PRESS, f"{where} is PASS without a whole curve that was judged so"


def _withdrawn(record: FullRecord, observer: Observer) -> bool:
    standing = record.standing
    return record.sequence not in observer.shown and standing is not None and standing.outcome == "NO_RESULT"


def _whole(record: FullRecord, deciding_mm: float) -> bool:
    judged = record.judged
    if judged is None or judged.outcome != "PASS" or judged.partial:
        return False
    reached_mm = max((point.closing_mm or 0.0 for point in judged.curve), default=0.0)
    return reached_mm + AT_MM >= deciding_mm and all(point.area_mm2 is not None for point in judged.curve)


def of_passage(passage: Passage, records: Sequence[FullRecord], *, bruised: bool) -> Iterator[Broken]:
    """Check what the PLC decided on a fruit.

    Args:
        passage: the PLC's decision.
        records: of the fruit's time.
        bruised: the fruit, by the twin.
    """
    if passage.decision in {Decision.REFUSED, Decision.NO_ANSWER}:
        return
    of_sequence = [record for record in records if record.sequence == passage.sequence]
    if not of_sequence or of_sequence[0].trigger.trigger_id != passage.trigger_id:
        yield NONE_STALE, f"trigger {passage.trigger_id} got sequence {passage.sequence}, which is not its own"
        return
    standing = of_sequence[0].standing
    if standing is not None and standing.outcome != passage.decision.value:
        yield ONE_OUTCOME, f"trigger {passage.trigger_id}: the PLC read {passage.decision}, it is {standing.outcome}"
    if passage.decision is Decision.PASS and bruised:
        yield WHOLE_PRESS, f"trigger {passage.trigger_id}: PASS of a bruised fruit"
