"""Messages of the outbox, which sends results to other systems."""

from station.messages.message import Name, Nested, Number, define, define_plural

SILENT = define("outbox.silent", "the outbox's process has not reported for {age_s} s", age_s=Number(0))
WAITING = define_plural(
    "outbox.waiting",
    "{destination}: {number} entry waits, for {age_s} s",
    "{destination}: {number} entries wait, for {age_s} s",
    "number",
    destination=Name(),
    number=Number(),
    age_s=Number(0),
)
WAITING_UNKNOWN = define(
    "outbox.waiting_unknown",
    "{destination}: it is not known how many entries wait, for {age_s} s",
    destination=Name(),
    age_s=Number(0),
)
LATE_BECAUSE = define("outbox.late_because", "{late}: {error}", late=Nested(), error=Name())
