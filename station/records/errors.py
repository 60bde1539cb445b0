"""Records errors, each with a code, a cause and a remedy."""

from station.errors import StationError
from station.messages.message import Message
from station.messages.records import FAULT


class RecordsError(StationError):
    """The records could not carry out a request."""

    code = "records"

    def __init__(self, cause: Message, remedy: Message) -> None:
        super().__init__(FAULT(cause=cause, remedy=remedy))
        self.cause = cause
        self.remedy = remedy


class DiskFullError(RecordsError):
    """The disk is full, or has less space than the reserve."""

    code = "disk_full"


class ReadOnlyError(RecordsError):
    """The folder or a file in it cannot be written."""

    code = "read_only"


class DiskError(RecordsError):
    """A read or write of the disk failed."""

    code = "disk_error"


class LockedError(RecordsError):
    """Another program has the database open, or another station the folder."""

    code = "locked"


class DamagedError(RecordsError):
    """The database or a backup is damaged or not authentic, or the database was removed while the station ran."""

    code = "damaged"


class SchemaError(RecordsError):
    """The database is a newer program's, or its migration failed."""

    code = "schema"


class SequenceError(RecordsError):
    """No sequence number can be given that was certainly never given before."""

    code = "sequence"


class RecordsDeadlineError(RecordsError):
    """The deadline passed: a trigger is withdrawn, a request that has not started is dropped.

    An outcome or a change under way may still be stored.
    """

    code = "deadline"


class UnknownInspectionError(RecordsError):
    """No inspection with this sequence exists."""

    code = "unknown_inspection"


class RecordsClosedError(RecordsError):
    """The records are closed."""

    code = "closed"


class BadRecordError(RecordsError):
    """The record is malformed: a fault of the program."""

    code = "bad_record"
