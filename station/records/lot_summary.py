"""Lot summary: the figures and examples of a lot's report, read in constant memory."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from station.charts.area_histogram import Bin
from station.messages import records as messages
from station.messages.reasons import reason_message
from station.records.database import plain, reading
from station.records.errors import RecordsError
from station.records.images import image_path
from station.records.search import Query, find_page

BINS = 24
EXAMPLES = 12
_SLICES = 48


@dataclass(frozen=True, slots=True)
class Example:
    """A rejected fruit."""

    sequence: int
    began_utc_ms: int
    outcome: str
    reasons: tuple[str, ...]
    area_mm2: float | None
    areas_mm2: tuple[float | None, ...]
    image: Path | None
    """Of its last step, if it was stored."""


@dataclass(frozen=True, slots=True)
class LotSummary:
    """Figures of one lot."""

    name: str
    grower: str
    began_utc_ms: int
    ended_utc_ms: int
    """Times of its first and last inspection."""
    first: int
    last: int
    outcomes: dict[str, int]
    """PASS, FAIL, NO_RESULT."""
    reasons: tuple[tuple[str, str, int], ...]
    """Name, sentence, inspections; the most frequent first."""
    recipes: tuple[tuple[str, str, str, int], ...]
    """Name, revision, SHA-256, inspections."""
    slices: tuple[tuple[int, int, int], ...]
    """PASS, FAIL, NO_RESULT in equal parts of the lot, in order of number."""
    areas: tuple[Bin, ...]
    """The deciding areas of all fruit that have one."""
    limits: tuple[tuple[float, float], ...]
    """Closing in mm and area in mm² of the most used recipe's limits."""
    sized: bool
    """That recipe's limits go with the fruit's length; those above are for its reference length."""
    mean_duration_s: float | None
    simulated: int
    late: int
    held: tuple[str, ...]
    examples: tuple[Example, ...]

    @property
    def total(self) -> int:
        """Return the number of inspections with an outcome."""
        return sum(self.outcomes.values())

    @property
    def not_accepted(self) -> int:
        """Return the number of inspections that are no PASS."""
        return self.total - self.outcomes["PASS"]

    @property
    def measured(self) -> int:
        """Return the number of inspections with a deciding area."""
        return sum(sum(counts) for _, *counts in self.areas)

    def share(self, outcome: str) -> float:
        """Return the share of one outcome."""
        return self.outcomes[outcome] / self.total if self.total else 0.0


def summarise(folder: Path, name: str) -> LotSummary:
    """Read a lot, by the name that the PLC gave it.

    Raises:
        RecordsError: no inspection has it, or the records cannot be read.
    """
    with reading(folder) as connection:
        ask = plain(connection).execute
        ends = (
            "SELECT min(sequence), max(sequence), min(began_utc_ms), max(began_utc_ms) FROM inspections WHERE lot = ?"
        )
        first, last, began, ended = ask(ends, (name,)).fetchone()
        if first is None:
            raise RecordsError(messages.LOT_WITHOUT_INSPECTIONS(lot=repr(name)), messages.LIST_SHOWS_LOTS())
        ended_so = "SELECT outcome, count(*) FROM inspections WHERE lot = ? AND outcome NOT NULL GROUP BY 1"
        outcomes = {"PASS": 0, "FAIL": 0, "NO_RESULT": 0, **dict(ask(ended_so, (name,)))}
        width = max(1, (last - first) // _SLICES + 1)
        slices = [[0, 0, 0] for _ in range((last - first) // width + 1)]
        counted = "SELECT (sequence - ?) / ?, outcome, count(*) FROM inspections WHERE lot = ? GROUP BY 1, 2"
        for index, outcome, number in ask(counted, (first, width, name)):
            if outcome in outcomes:
                slices[index][list(outcomes).index(outcome)] = number
        reasons = ask(
            "SELECT json_each.value, count(*) FROM inspections, json_each(standing, '$.reasons') WHERE lot = ? "
            "GROUP BY 1 ORDER BY 2 DESC, 1",
            (name,),
        ).fetchall()
        recipes = ask(
            "SELECT r.name, r.revision, r.sha256, count(*) FROM inspections AS i JOIN recipe_snapshots AS r "
            "ON r.sha256 = i.recipe_sha256 WHERE lot = ? GROUP BY r.sha256 ORDER BY 4 DESC",
            (name,),
        ).fetchall()
        limits, sized = _limits(ask, recipes[0][2]) if recipes else ((), False)
        mean_s, simulated, late = ask(
            "SELECT avg(nullif(json_extract(standing, '$.duration_ms'), 0)) / 1000.0, sum(simulated), "
            "sum(json_extract(standing, '$.late')) FROM inspections WHERE lot = ?",
            (name,),
        ).fetchone()
        held = ask(
            "SELECT coalesce('inspection ' || sequence, 'the lot') || ': ' || reason FROM holds "
            "WHERE released_utc_ms IS NULL "
            "AND (lot = ? OR sequence IN (SELECT sequence FROM inspections WHERE lot = ?))",
            (name, name),
        ).fetchall()
        grower = ask("SELECT grower FROM lots WHERE name = ?", (name,)).fetchone()
        return LotSummary(
            name=name,
            grower=grower[0] if grower else "",
            began_utc_ms=began,
            ended_utc_ms=ended,
            first=first,
            last=last,
            outcomes=outcomes,
            reasons=tuple((why, str(reason_message(why)), number) for why, number in reasons),
            recipes=tuple(recipes),
            slices=tuple((ok, bad, none) for ok, bad, none in slices),
            areas=_areas(ask, name),
            limits=limits,
            sized=sized,
            mean_duration_s=mean_s,
            simulated=simulated or 0,
            late=late or 0,
            held=tuple(text for (text,) in held),
            examples=tuple(_examples(connection, folder, name)),
        )


def _areas(ask: Any, name: str) -> tuple[Bin, ...]:
    areas = "(SELECT json_extract(standing, '$.area_mm2') AS area_mm2, outcome FROM inspections WHERE lot = ?)"
    largest = ask(f"SELECT max(area_mm2) FROM {areas}", (name,)).fetchone()[0]  # noqa: S608 (a constant)
    if not largest:
        return ()
    width = largest / BINS
    counts = [Counter[str]() for _ in range(BINS)]
    query = f"SELECT min(CAST(area_mm2 / ? AS INTEGER), ?), outcome, count(*) FROM {areas} WHERE area_mm2 NOT NULL GROUP BY 1, 2"  # noqa: E501, S608 (a constant)
    for index, outcome, number in ask(query, (width, BINS - 1, name)):
        counts[max(0, index)][outcome] = number
    return tuple(
        (width * (index + 1), each["PASS"], each["FAIL"], each["NO_RESULT"]) for index, each in enumerate(counts)
    )


def _limits(ask: Any, sha256: str) -> tuple[tuple[tuple[float, float], ...], bool]:
    """Read a recipe's limits on areas, and whether they go with the fruit's size; none of an unknown format."""
    (text,) = ask("SELECT text FROM recipe_snapshots WHERE sha256 = ?", (sha256,)).fetchone()
    try:
        damage = json.loads(text)["damage"]
        limits = tuple((float(each["closing_mm"]), float(each["area_mm2"])) for each in damage["area"])
    except (ValueError, KeyError, TypeError):
        return (), False
    return limits, bool(damage.get("size"))


def _examples(connection: Any, folder: Path, name: str) -> list[Example]:
    """Read the last rejected fruit."""
    ask = plain(connection).execute
    found = []
    for row in find_page(connection, Query(lot=name, outcome="FAIL"), EXAMPLES).rows:
        kept = ask(
            "SELECT sha256 FROM images WHERE sequence = ? AND kind = 'step' ORDER BY step DESC LIMIT 1", (row.sequence,)
        ).fetchone()
        path = Path(image_path(folder, kept[0])) if kept else None
        area = ask("SELECT standing FROM inspections WHERE sequence = ?", (row.sequence,)).fetchone()[0]
        found.append(
            Example(
                row.sequence,
                row.began_utc_ms,
                row.outcome or "",
                row.reasons,
                json.loads(area).get("area_mm2"),
                row.areas_mm2,
                path if path is not None and path.exists() else None,
            )
        )
    return found
