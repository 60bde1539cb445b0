"""Search: inspections by lot, grower, fruit, time, outcome and reason, newest first, a page at a time.

Each condition is a list of numbers in an index, which finds "the highest one not above this" in one access. A page is
the intersection of such lists, by leaps ("leapfrog join", Veldhuizen, ICDT 2014, section 3): numbers that a condition
rules out are skipped in one leap, and nothing is counted, sorted or read twice. SQL alone would choose one index and
read all that it names.
"""

import heapq
import sqlite3
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

from sqlalchemy import Connection

from station.channel.line import OutcomeName, Reason
from station.messages import records as messages
from station.records.database import plain
from station.records.errors import RecordsError
from station.records.high_water_mark import LARGEST
from station.records.queries import Summary, read_summaries
from station.records.search_index import HOUR_MS

LARGEST_PAGE = 1000

Seek = Callable[[int], int | None]
"""The highest number of a list that is not above this one."""


@dataclass(frozen=True, slots=True)
class Query:
    """Search conditions: all that are given have to be met."""

    lot: str | None = None
    grower: str | None = None
    """The lot's grower, as registered with its start."""
    from_utc_ms: int | None = None
    """Started at this time or later."""
    to_utc_ms: int | None = None
    """Started before this time."""
    outcome: OutcomeName | None = None
    """The outcome in force."""
    reason: Reason | None = None
    """Any reason of the outcome in force, not only the first."""
    fruit: str | None = None
    """Name of the recipe, in any revision."""


class Page(NamedTuple):
    """One page of a result, newest first."""

    rows: tuple[Summary, ...]
    below: int | None
    """Argument for the next page; None if this is the last."""


def find_page(connection: Connection, query: Query, limit: int = 50, below: int | None = None) -> Page:
    """Return one page of a result, up to `LARGEST_PAGE`; `below` is of the page before, None for the first page.

    Raises:
        RecordsError: the limit is invalid.
    """
    if not 1 <= limit <= LARGEST_PAGE:
        raise RecordsError(messages.PAGE_TOO_LARGE(number=limit), messages.ASK_FOR_FEWER(most=LARGEST_PAGE))
    found = list(islice(find(connection, query, LARGEST if below is None else below - 1), limit + 1))
    rows = tuple(read_summaries(connection, found[:limit]))
    return Page(rows, found[limit - 1] if len(found) > limit else None)


def find(connection: Connection, query: Query, highest: int = LARGEST) -> Iterator[int]:
    """Yield the matching numbers, highest first; the connection is in use until the last number was taken."""
    database = plain(connection)
    lists = _lists(database, query)
    timed = query.from_utc_ms is not None or query.to_utc_ms is not None
    earliest, latest = query.from_utc_ms or 0, 2**63 - 1 if query.to_utc_ms is None else query.to_utc_ms - 1
    number: int | None = highest
    while number is not None and (number := _common(lists, number)) is not None:
        if not timed or earliest <= _began(database, number) <= latest:
            yield number
        number -= 1


def _common(lists: list[Seek], highest: int) -> int | None:
    """Return the highest number that is in every list."""
    while True:
        number = highest
        for seek in lists:
            found = seek(number)
            if found is None:
                return None
            number = found
        if number == highest:
            return number
        highest = number


def _lists(database: sqlite3.Connection, query: Query) -> list[Seek]:
    """Return the lists, those that are likely to be short first; at least one lists existing numbers only."""
    lists: list[Seek] = []
    if query.reason is not None:
        lists.append(_with_reason(database, query.reason, query.outcome))
    if query.grower is not None:
        lists.append(_of_grower(database, query.grower, query.outcome))
    if query.lot is not None:
        chosen = [query.outcome] if query.outcome else []
        lists.append(_seek(database, _lot_statement("?", query.outcome), query.lot, *chosen))
    elif query.outcome is not None and not lists:
        lists.append(
            _seek(
                database,
                "SELECT sequence FROM inspections INDEXED BY ix_inspections_outcome WHERE outcome = ? "
                "AND sequence <= ? ORDER BY sequence DESC LIMIT 1",
                query.outcome,
            )
        )
    if query.fruit is not None:
        lists.append(_of_fruit(database, query.fruit))
    if not lists:
        lists.append(
            _seek(database, "SELECT sequence FROM inspections WHERE sequence <= ? ORDER BY sequence DESC LIMIT 1")
        )
    timed = query.from_utc_ms is not None or query.to_utc_ms is not None
    return [_in_time(database, query.from_utc_ms or 0, query.to_utc_ms), *lists] if timed else lists


def _seek(database: sqlite3.Connection, statement: str, *values: str) -> Seek:
    cursor = database.cursor()

    def seek(highest: int) -> int | None:
        found = cursor.execute(statement, (*values, highest)).fetchone()
        return found and found[0]

    return seek


def _with_reason(database: sqlite3.Connection, reason: Reason, outcome: OutcomeName | None) -> Seek:
    """Return the list of one outcome, or of the two that have reasons."""
    statement = (
        "SELECT sequence FROM reasons WHERE reason = ? AND outcome = ? AND sequence <= ? ORDER BY sequence DESC LIMIT 1"
    )
    seeks = [_seek(database, statement, reason, each) for each in ([outcome] if outcome else ["FAIL", "NO_RESULT"])]

    def seek(highest: int) -> int | None:
        return max((found for each in seeks if (found := each(highest)) is not None), default=None)

    return seek


def _lot_statement(lot: str, outcome: OutcomeName | None) -> str:
    index, also = ("ix_inspections_lot_outcome", "AND outcome = ?") if outcome else ("ix_inspections_lot", "")
    return (
        f"SELECT sequence FROM inspections INDEXED BY {index} WHERE lot = {lot} {also} "  # noqa: S608 (of constants)
        "AND sequence <= ? ORDER BY sequence DESC LIMIT 1"
    )


def _of_grower(database: sqlite3.Connection, grower: str, outcome: OutcomeName | None) -> Seek:
    """Merge the lots' lists."""
    chosen = (outcome,) if outcome else ()
    head = _lot_statement("lots.name", outcome)
    heads = database.execute(
        f"SELECT name, ({head}) AS head FROM lots WHERE grower = ? AND head NOT NULL",  # noqa: S608 (of constants)
        (*chosen, LARGEST, grower),
    )
    statement, cursor = _lot_statement("?", outcome), database.cursor()
    return _merged(heads, lambda lot, highest: cursor.execute(statement, (lot, *chosen, highest)).fetchone())


def _of_fruit(database: sqlite3.Connection, fruit: str) -> Seek:
    """Merge the lists of the recipe's revisions."""
    head = (
        "SELECT sequence FROM inspections INDEXED BY ix_inspections_recipe_sha256 WHERE recipe_sha256 = {} "
        "AND sequence <= ? ORDER BY sequence DESC LIMIT 1"
    )
    heads = database.execute(
        f"SELECT sha256, ({head.format('sha256')}) AS head FROM recipe_snapshots "  # noqa: S608 (of constants)
        "WHERE name = ? AND head NOT NULL",
        (LARGEST, fruit),
    )
    statement, cursor = head.format("?"), database.cursor()
    return _merged(heads, lambda sha256, highest: cursor.execute(statement, (sha256, highest)).fetchone())


def _merged(heads: Iterable[tuple[str, int]], find: Callable[[str, int], tuple[int] | None]) -> Seek:
    """Merge lists: a heap of each one's highest number not above the last query."""
    heap = [(-head, name) for name, head in heads]
    heapq.heapify(heap)

    def seek(highest: int) -> int | None:
        while heap and -heap[0][0] > highest:
            name = heap[0][1]
            found = find(name, highest)
            if found is None:
                heapq.heappop(heap)
            else:
                heapq.heapreplace(heap, (-found[0], name))
        return -heap[0][0] if heap else None

    return seek


def _in_time(database: sqlite3.Connection, from_utc_ms: int, to_utc_ms: int | None) -> Seek:
    """Return the spans of numbers given in these hours."""
    last_hour = 2**62 if to_utc_ms is None else (to_utc_ms - 1) // HOUR_MS
    spans = database.execute(
        "SELECT first_sequence, coalesce((SELECT next.first_sequence FROM hours AS next WHERE next.first_sequence > "
        "hours.first_sequence ORDER BY next.first_sequence LIMIT 1) - 1, ?) FROM hours WHERE hour BETWEEN ? AND ? "
        "ORDER BY first_sequence",
        (LARGEST, from_utc_ms // HOUR_MS, last_hour),
    ).fetchall()
    firsts = [first for first, _ in spans]

    def seek(highest: int) -> int | None:
        at = bisect_right(firsts, highest) - 1
        return None if at < 0 else min(highest, spans[at][1])

    return seek


def _began(database: sqlite3.Connection, number: int) -> int:
    """Return when an inspection began; before all time if there is none with this number."""
    row = database.execute("SELECT began_utc_ms FROM inspections WHERE sequence = ?", (number,)).fetchone()
    return -1 if row is None else row[0]
