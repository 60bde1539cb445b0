"""Messages of the pages' jobs and requests."""

from station.messages.message import Number, define, define_plural

TOO_MANY = define_plural(
    "job.too_many",
    "{number} export or replay is under way; wait for it, or cancel it",
    "{number} exports and replays are under way; wait for one, or cancel one",
    "number",
)
NO_FOLDER = define("job.no_folder", "{folder}: {error}; make it writable")
DISK_FULL = define(
    "job.disk_full", "{free_mb} MB are free on the disk of {folder}; free space first", free_mb=Number(0)
)
UNKNOWN = define("job.unknown", "this job is not known any more; begin it again")
LATE = define("job.late", "it was not done within {limit_min} min; ask for less")
NOT_STARTED = define("job.not_started", "it could not be started: {error}")
REQUESTS_FULL = define("job.requests_full", "{number} requests of the pages are waiting; try again in a moment")
REQUEST_SLOW = define("job.request_slow", "no answer within {limit_s} s; ask for less, or try again in a moment")
NO_PICTURE = define("job.no_picture", "no picture was taken of inspection {sequence}", sequence=Number())
NOT_RECENT = define(
    "job.not_recent", "inspection {sequence} is not among the last {number}: look into the history", sequence=Number()
)
PICTURE_NOT_ENCODED = define("job.picture_not_encoded", "the picture could not be encoded")
NO_TIME = define("job.no_time", "{utc_ms} ms is outside the calendar; give another time")
UNPRINTABLE = define("job.unprintable", "{text} contains what cannot be printed; give a name of printable letters")
