"""Transactions of another process than the station's, between two of the station's writes."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from sqlalchemy import Connection

from station.records.audit import continue_audit, newer_head
from station.records.audit_head import read_head, try_save_head
from station.records.database import existing, open_engine
from station.records.error_mapping import map_error
from station.records.errors import RecordsError


@contextmanager
def short_transaction(folder: Path) -> Iterator[Connection]:
    """Run one transaction: durable when the block ends, rolled back if it raises. The station waits: be short.

    Raises:
        RecordsError: there are no records, or they cannot be changed.
    """
    path = existing(folder)
    try:
        with open_engine(path, "rw").begin() as connection:
            head = read_head(folder)
            continue_audit(connection, head)
            yield connection
            ahead = newer_head(connection, head)
        if ahead is not None:
            try_save_head(folder, ahead)
    except RecordsError:
        raise
    except Exception as error:
        raise map_error(error, str(path)) from error
