"""Check of the causes of a records' error, for the tests."""

from collections.abc import Callable

from station.messages.message import Definition
from station.records.errors import RecordsError


def because(*causes: Definition) -> Callable[[RecordsError], bool]:
    """Return a check that an error has one of these causes."""
    return lambda error: error.cause.id in {each.id for each in causes}
