"""What can be wrong with the records: each with a code, a cause and a remedy."""

from station.errors import StationError


class RecordsError(StationError):
    """The records could not do what they were asked."""

    code = "records"

    def __init__(self, cause: str, remedy: str) -> None:
        super().__init__(f"records: {cause}; {remedy}")
        self.cause = cause
        self.remedy = remedy


class DiskFullError(RecordsError):
    """No space is left, or less than the reserve."""

    code = "disk_full"


class ReadOnlyError(RecordsError):
    """The folder or a file in it cannot be written."""

    code = "read_only"


class DiskError(RecordsError):
    """The disk did not read or write."""

    code = "disk_error"


class LockedError(RecordsError):
    """Another program holds the database, or another station the folder."""

    code = "locked"


class DamagedError(RecordsError):
    """The database is damaged, or was taken away while the station ran."""

    code = "damaged"


class SchemaError(RecordsError):
    """The database is of a newer program, or could not be brought to this one's form."""

    code = "schema"


class SequenceError(RecordsError):
    """No sequence number can be given that was surely never given before."""

    code = "sequence"


class RecordsDeadlineError(RecordsError):
    """Not done in time. What was asked is then not carried out, or withdrawn, except an outcome under way."""

    code = "deadline"


class UnknownInspectionError(RecordsError):
    """No inspection with this sequence was ever begun."""

    code = "unknown_inspection"


class RecordsClosedError(RecordsError):
    """The records are closed."""

    code = "closed"


class BadRecordError(RecordsError):
    """What was to be recorded is malformed: a fault of the program."""

    code = "bad_record"
