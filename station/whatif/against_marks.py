"""Comparison of a draft with people's marks: both errors before and after, corrected and new errors."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from station.records.marks import Mark
from station.whatif.limits import rate_interval
from station.whatif.replay import Replayed


@dataclass(frozen=True, slots=True)
class Compared:
    """The marked fruit that the draft decides."""

    good: int
    bad: int
    diverted: tuple[int, int]
    """Good ones that did not pass, before and after."""
    passed: tuple[int, int]
    """Bad ones that passed, before and after."""
    now_right: tuple[int, ...]
    """Sequences of fruit that were sorted wrongly and would be sorted rightly."""
    now_wrong: tuple[int, ...]
    undecided: int
    """Marked fruit without a known result by the draft."""

    def figures(self) -> dict[str, Any]:
        """Return the figures by name, each error with its 95 % interval."""
        figures: dict[str, Any] = {
            "good": self.good,
            "bad": self.bad,
            "undecidable": self.undecided,
            "now_right": list(self.now_right),
            "now_wrong": list(self.now_wrong),
        }
        both = (("good_diverted", self.diverted, self.good), ("bad_passed", self.passed, self.bad))
        for name, counts, of in both:
            for when, count in zip(("before", "after"), counts, strict=True):
                interval = rate_interval(count, of)
                figures[f"{name}_{when}"] = {"count": count, "interval": [interval.low, interval.high]}
        return figures

    def lines(self) -> list[str]:
        """Describe the comparison in sentences."""
        lines = [
            f"{name}: {self._share(counts[0], of)} before, {self._share(counts[1], of)} after"
            for name, counts, of in (
                ("marked good and diverted", self.diverted, self.good),
                ("marked bad and passed", self.passed, self.bad),
            )
        ]
        for name, sequences in (("now right", self.now_right), ("now wrong", self.now_wrong)):
            if sequences:
                lines.append(f"{name}: {', '.join(map(str, sequences))}")
        if self.undecided:
            lines.append(f"{self.undecided} more marked fruit cannot be known")
        return lines

    @staticmethod
    def _share(count: int, of: int) -> str:
        interval = rate_interval(count, of)
        if interval.low is None or interval.high is None:
            return f"{count} of {of}"
        return f"{count} of {of} ({100 * interval.low:.1f} to {100 * interval.high:.1f} %)"


def compared(results: Iterable[Replayed], marks: Mapping[int, Mark]) -> Compared | None:
    """Compare a draft's outcomes with people's marks by sequence; None if no fruit of the results is marked."""
    marked = [(each, marks[each.sequence] == "good") for each in results if each.sequence in marks]
    decided = [(each, good) for each, good in marked if each.after != "UNDECIDABLE"]
    if not marked:
        return None
    wrong = [
        (each.sequence, good, (each.before == "PASS") != good, (each.after == "PASS") != good) for each, good in decided
    ]

    def count(*, of_good: bool) -> tuple[int, int]:
        before, after = (sum(one[place] for one in wrong if one[1] == of_good) for place in (2, 3))
        return before, after

    return Compared(
        good=sum(good for _, good in decided),
        bad=sum(not good for _, good in decided),
        diverted=count(of_good=True),
        passed=count(of_good=False),
        now_right=tuple(sequence for sequence, _, before, after in wrong if before and not after),
        now_wrong=tuple(sequence for sequence, _, before, after in wrong if after and not before),
        undecided=len(marked) - len(decided),
    )
