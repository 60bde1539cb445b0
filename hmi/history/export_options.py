"""A search as options of `station records export`."""

from datetime import UTC, datetime

from station.channel.panel_lots import Search
from station.errors import BadInputError
from station.messages import jobs as messages


def options_of(search: Search) -> list[str]:
    """Return a search as options of the command line.

    Raises:
        BadInputError: a text is not printable, or a time is none.
    """
    given = {
        "lot": search.lot,
        "grower": search.grower,
        "outcome": search.outcome,
        "reason": search.reason,
        "fruit": search.fruit,
        "from": None if search.from_utc_ms is None else _iso(search.from_utc_ms),
        "to": None if search.to_utc_ms is None else _iso(search.to_utc_ms),
    }
    chosen = {name: str(value) for name, value in given.items() if value is not None}
    for value in chosen.values():
        check_text(value)
    return [f"--{name}={value}" for name, value in chosen.items()]


def _iso(utc_ms: int) -> str:
    try:
        return datetime.fromtimestamp(utc_ms / 1000, UTC).isoformat()
    except (ValueError, OverflowError) as error:
        raise BadInputError(messages.NO_TIME(utc_ms=utc_ms)) from error


def check_text(text: str) -> None:
    """Refuse a text that is not printable.

    Raises:
        BadInputError: it is not.
    """
    if not text.isprintable():
        raise BadInputError(messages.UNPRINTABLE(text=repr(text)))
