"""Outcome table of a draft: counts of changed outcomes."""

import csv
import io
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from station.messages.message import ENGLISH, Renderer
from station.records.csv_cell import csv_cell
from station.whatif.replay import Replayed

BEFORE = ("PASS", "FAIL", "NO_RESULT")
AFTER = (*BEFORE, "UNDECIDABLE")
_WITHOUT_FIGURES = Renderer(ENGLISH.form, lambda _value, _digits: "…")


@dataclass(frozen=True, slots=True)
class Counted:
    """Counts of all results of one draft."""

    pairs: Counter[tuple[str, str]]
    """Number by outcome before and outcome after."""
    undecidable: Counter[str]
    """Reasons, without their figures."""
    unfaithful: int
    """Inspections whose own recipe now gives another outcome than the stored one: by an older judge, or a fault."""
    newly_rejected: int
    newly_passed: int
    measured_again: int
    """Number of inspections whose stored images were measured by the draft."""

    @property
    def total(self) -> int:
        """Return the number of inspections judged again."""
        return self.pairs.total()

    @property
    def decided(self) -> int:
        """Return the number of them with a verdict by the draft."""
        return self.total - sum(self.pairs[before, "UNDECIDABLE"] for before in BEFORE)

    def rejects_before(self) -> int:
        """Return the number of decided ones that did not pass before."""
        return sum(number for (before, after), number in self.pairs.items() if before != "PASS" and after in BEFORE)

    def rejects_after(self) -> int:
        """Return the number of decided ones that the draft does not pass."""
        return sum(number for (_, after), number in self.pairs.items() if after in {"FAIL", "NO_RESULT"})

    def summary(self) -> dict[str, Any]:
        """Return the figures by name."""
        return {
            "inspections": self.total,
            "decided": self.decided,
            "undecidable": self.total - self.decided,
            "undecidable_because": dict(self.undecidable.most_common()),
            "rejects_before": self.rejects_before(),
            "rejects_after": self.rejects_after(),
            "newly_rejected": self.newly_rejected,
            "newly_passed": self.newly_passed,
            "not_reproduced": self.unfaithful,
            "measured_again": self.measured_again,
            "outcomes": {f"{before} to {after}": self.pairs[before, after] for before in BEFORE for after in AFTER},
        }


def counted(results: Iterable[Replayed]) -> Counted:
    """Count results."""
    pairs: Counter[tuple[str, str]] = Counter()
    why: Counter[str] = Counter()
    sides: Counter[str] = Counter()
    unfaithful = measured_again = 0
    for each in results:
        pairs[each.before, each.after] += 1
        sides[each.changes_side] += 1
        unfaithful += not each.faithful
        measured_again += bool(each.areas_mm2)
        if each.after == "UNDECIDABLE":
            why[_WITHOUT_FIGURES.sentence(each.why) if each.why is not None else ""] += 1
    return Counted(pairs, why, unfaithful, sides["rejected"], sides["passes"], measured_again)


def as_csv(results: Sequence[Replayed]) -> str:
    """Return every changed result, as a table."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["sequence", "lot", "before", "after", "changes_side", "why"])
    for each in results:
        if each.before != each.after:
            table.writerow(
                [each.sequence, csv_cell(each.lot), each.before, each.after, each.changes_side, each.why or ""]
            )
    return text.getvalue()
