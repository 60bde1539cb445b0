"""Typed limits tried on past fruit: what they would divert, and both errors against people's marks."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from station.records.database import reading
from station.records.marks import Mark, read_marked
from station.settings.recipe_model import Recipe
from station.whatif.against_marks import Compared, compared
from station.whatif.limits import Interval, rate_interval
from station.whatif.outcome_table import counted
from station.whatif.replay import recipe_of_snapshot, replay
from station.whatif.stored import read_stored, sequences, snapshots

_LAST = 60
"""Fruit of which the diverted are counted, as many as the chart draws."""
_MARKED = 200
"""The latest marked ones, of any recipe: with some milliseconds each, the answer comes while a person still looks."""


class Error(NamedTuple):
    """One kind of wrong outcome among the marked fruit."""

    name: str
    """`good`, diverted, or `bad`, passed."""
    of: int
    """Marked fruit whose result by the draft is known."""
    before: int
    after: int
    interval: Interval
    """Of the share after, 95 %."""


@dataclass(frozen=True, slots=True)
class Tried:
    """Counts of past fruit that were diverted, and would be by a draft, with their comparison with people's marks."""

    last: int
    """Latest judged fruit."""
    decided: int
    """Those of them whose result by the draft is known."""
    diverted_before: int
    """Of those decided."""
    diverted_after: int
    against: Compared | None
    """Comparison with people's marks; None if no fruit is marked."""

    @property
    def errors(self) -> tuple[Error, ...]:
        """Both errors; none if no fruit is marked."""
        if (found := self.against) is None:
            return ()
        both = (("good", found.good, found.diverted), ("bad", found.bad, found.passed))
        return tuple(Error(name, of, *counts, rate_interval(counts[1], of)) for name, of, counts in both)


def read_tried(folder: Path, draft: Recipe) -> Tried | None:
    """Judge past fruit by a draft; a result that cannot be known is counted apart.

    Args:
        folder: the records'.
        draft: the recipe to try. One that measures images otherwise decides nothing here: `station whatif` does.

    Returns:
        None before the first judged fruit.
    """
    with reading(folder) as connection:
        last = set(sequences(connection, draft.name, (), _LAST))
        marks: dict[int, Mark] = {each.sequence: each.mark for each in read_marked(connection)[-_MARKED:]}
        stored = read_stored(connection, sorted(last | marks.keys()), folder, with_images=False)
        texts = snapshots(connection, draft.name)
    if not last:
        return None
    own = {sha256: recipe_of_snapshot(text) for sha256, text in texts.items()}
    results = [replay(each, own[each.recipe_sha256], draft) for each in stored if each.recipe_sha256 in own]
    counts = counted(each for each in results if each.sequence in last)
    return Tried(len(last), counts.decided, counts.rejects_before(), counts.rejects_after(), compared(results, marks))
