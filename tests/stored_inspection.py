"""Reading of one inspection's record in a test, as other processes read it."""

from typing import Any

from station.records.database import reading
from station.records.queries import read_inspection
from station.records.records import Records


def read_record(records: Records, sequence: int) -> Any:
    """Return all stored data of one inspection, a `FullRecord`: each test knows which parts of it there are."""
    with reading(records.folder) as connection:
        return read_inspection(connection, sequence, records.folder)
