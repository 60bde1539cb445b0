"""Chips and day buttons of the history page: a search by one touch, as links."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import NamedTuple
from urllib.parse import urlencode

Terms = Mapping[str, str]
"""A search, by the names of its fields; an empty text is no condition."""


class Chip(NamedTuple):
    """One search that a touch switches on and off."""

    name: str
    """Its text is `history.chip_NAME`."""
    value: str
    address: str
    on: bool


class Days(NamedTuple):
    """The day that is searched, and the addresses of those beside it."""

    utc_ms: int | None
    """None where the search is not of one day; then the addresses are those beside today, or beside its begin."""
    before: str
    after: str


def chips(terms: Terms, lot: str | None, today: datetime) -> list[Chip]:
    """Return the chips, for the current lot if any and the local time; each leaves the other conditions."""
    wanted = {
        "today": _day(today),
        "lot": {"lot": lot or ""},
        "fail": {"outcome": "FAIL"},
        "unjudged": {"outcome": "NO_RESULT"},
    }
    made = []
    for name, changes in wanted.items():
        if any(changes.values()):
            on = all(terms[key] == value for key, value in changes.items())
            others = dict.fromkeys(changes, "") if on else changes
            made.append(Chip(name, lot or "", _address(terms, others), on))
    return made


def days(terms: Terms, today: datetime) -> Days:
    """Return the day of the search, if it is of one, and the days beside it or beside today."""
    try:
        return _beside(terms, datetime.fromisoformat(terms["from"]).astimezone())
    except (ValueError, OverflowError):  # a day beside the calendar's first or last
        return _beside(terms, today)


def unseen(terms: Terms, lot: str | None, day: Days) -> bool:
    """Return whether the search has a condition that neither a chip nor the date shows."""
    seen = {
        "lot": terms["lot"] == lot,
        "outcome": terms["outcome"] in {"FAIL", "NO_RESULT"},
        "from": day.utc_ms is not None,
        "to": day.utc_ms is not None,
    }
    return any(value and not seen.get(name) for name, value in terms.items())


def _beside(terms: Terms, shown: datetime) -> Days:
    before, after = (_address(terms, _day(shown + timedelta(days=step))) for step in (-1, 1))
    is_day = {name: terms[name] for name in ("from", "to")} == _day(shown)
    return Days(round(1000 * shown.timestamp()) if is_day else None, before, after)


def _day(at: datetime) -> dict[str, str]:
    begin = datetime(at.year, at.month, at.day)  # noqa: DTZ001 (local, as a browser's field has it)
    return {"from": f"{begin:%Y-%m-%dT%H:%M}", "to": f"{begin + timedelta(days=1):%Y-%m-%dT%H:%M}"}


def _address(terms: Terms, changes: Mapping[str, str]) -> str:
    given = {key: value for key, value in {**terms, **changes}.items() if value}
    return f"/history?{urlencode(given)}" if given else "/history"
