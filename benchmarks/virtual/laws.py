"""Laws of a play: what the line's PLC may see, and what may move; a broken one ends the play."""

from collections.abc import Collection, Mapping
from typing import Any

from plc_interface.plc_simulator.program import Decision, Passage
from plc_interface.registers.map import BY_NAME
from station.inspection.cycle import Event
from station.inspection.evidence import AT_MM
from station.inspection.press import Press
from station.inspection.states import State
from station.settings.recipe_model import Recipe

from .records import Record

ONE_OUTCOME = "one outcome for each accepted trigger"
NONE_STALE = "no outcome of another fruit is used"
NONE_DOUBLED = "no outcome is shown twice or changed"
WHOLE_PRESS = "no PASS without a whole trusted press"
NOTHING_MOVES = "nothing moves in a held state"
NONE_TAKEN = "no fruit is moved while the jaws may hold it"
ALARMS_RETURN = "alarms return to normal, and the line runs again"
LAWS = (ONE_OUTCOME, NONE_STALE, NONE_DOUBLED, WHOLE_PRESS, NOTHING_MOVES, NONE_TAKEN, ALARMS_RETURN)

HELD = {State.UNKNOWN, State.STOPPED, State.HELD, State.CARRIED, State.LATCHED, State.RECORDING_LATCHED}
"""States in which no motion is under way."""
_FOR_A_PERSON = {State.CARRIED, State.LATCHED, State.RECORDING_LATCHED}
_VALID = BY_NAME["status"].flags(["result_valid"])
_OUTCOMES = BY_NAME["result_outcome"].codes


class LawBrokenError(AssertionError):
    """A law does not hold."""

    def __init__(self, law: str, what: str) -> None:
        super().__init__(f"{law}: {what}")
        self.law = law


class Laws:
    """Checker of the laws in one play, with what was seen of the play so far."""

    def __init__(self, recipe: Recipe, records: Mapping[int, Record]) -> None:
        self._recipe, self._records = recipe, records
        self._shown: dict[int, tuple[Any, ...]] = {}
        self._taken = 0
        self._accepted: set[int] = set()

    def accepted(self, sequence: int) -> None:
        """The PLC received that a trigger is accepted."""
        self._accepted.add(sequence)

    def seen(self, registers: Mapping[str, Any]) -> None:
        """The PLC can read these registers."""
        self._taken = max(self._taken, registers["acknowledged_sequence_echo"])
        if not registers["status"] & _VALID:
            return
        sequence = registers["result_sequence"]
        block = tuple(value for name, value in registers.items() if name.startswith("result_") and name[7:9] != "de")
        if self._shown.setdefault(sequence, block) != block:
            raise LawBrokenError(NONE_DOUBLED, f"two outcomes under sequence {sequence}")
        if sequence <= self._taken:
            raise LawBrokenError(NONE_DOUBLED, f"sequence {sequence} is shown after {self._taken} was acknowledged")
        record = self._records[sequence]
        if registers["result_trigger_id"] != record.trigger_id:
            raise LawBrokenError(NONE_STALE, f"sequence {sequence} has another trigger's id")
        outcome = _OUTCOMES[registers["result_outcome"]].name
        if outcome not in {"NO_RESULT", record.judged}:
            raise LawBrokenError(ONE_OUTCOME, f"sequence {sequence} is {outcome}, and was judged {record.judged}")

    def passed(self, passage: Passage) -> None:
        """The PLC has decided on a fruit."""
        if passage.decision not in {Decision.PASS, Decision.FAIL}:
            return
        record = self._records[passage.sequence]
        if record.fruits != {passage.number}:
            raise LawBrokenError(NONE_STALE, f"fruit {passage.number} got what was measured of {record.fruits}")
        if passage.decision is Decision.PASS:
            self._whole(passage.sequence, record.press)

    def _whole(self, sequence: int, press: Press | None) -> None:
        """A PASS's press by a plain rule of its own, apart from the judge: a trusted area within the last limit."""
        if press is None or press.interruptions or press.onset_mm is None:
            raise LawBrokenError(WHOLE_PRESS, f"sequence {sequence} was interrupted, or met nothing")
        last = self._recipe.damage.area[-1]
        least = self._recipe.segmentation.robust.least_confidence
        ordered = sorted(press.points, key=lambda point: point.closing_mm)
        beyond = [point for point in ordered if point.closing_mm >= last.closing_mm - AT_MM]
        if not beyond:
            raise LawBrokenError(WHOLE_PRESS, f"sequence {sequence} ends before {last.closing_mm} mm")
        after = beyond[0]
        before = after if after.closing_mm <= last.closing_mm else ordered[-len(beyond) - 1]
        share = (last.closing_mm - before.closing_mm) / ((after.closing_mm - before.closing_mm) or 1.0)
        area_mm2 = before.area_mm2 + share * (after.area_mm2 - before.area_mm2)
        doubtful = any(point.flags or (point.confidence or 0.0) < least for point in (before, after))
        if doubtful or area_mm2 > last.area_mm2:
            raise LawBrokenError(WHOLE_PRESS, f"sequence {sequence} passed by {area_mm2} mm², {before}, {after}")

    @staticmethod
    def cycle(before: State, event: Event, after: State, moving: Collection[str]) -> None:
        """The cycle took an event, and its actions have started."""
        if after in HELD and moving:
            raise LawBrokenError(NOTHING_MOVES, f"{', '.join(moving)} in {after}")
        ends = before in _FOR_A_PERSON and after not in _FOR_A_PERSON
        if ends and event is not Event.PERSON_CONFIRMED:
            raise LawBrokenError(NOTHING_MOVES, f"{before} is left by {event}, without a person")

    @staticmethod
    def moved(number: int, *, jaws_open: bool) -> None:
        """The line has moved a fruit out of the nest."""
        if not jaws_open:
            raise LawBrokenError(NONE_TAKEN, f"fruit {number}")

    def ended(self, counted_doubled: int) -> None:
        """All troubles are over, and the line has come to rest."""
        if counted_doubled:
            raise LawBrokenError(NONE_DOUBLED, f"the PLC counted {counted_doubled} doubled results")
        for sequence in sorted(self._accepted):
            if sequence not in self._shown or sequence > self._taken:
                raise LawBrokenError(ONE_OUTCOME, f"accepted sequence {sequence} got no outcome")
        for sequence, record in self._records.items():
            if record.standing is None:
                raise LawBrokenError(ONE_OUTCOME, f"the records have no outcome of {sequence}")
        for sequence in self._shown.keys() - self._accepted:
            raise LawBrokenError(ONE_OUTCOME, f"sequence {sequence} has an outcome and was not accepted")
