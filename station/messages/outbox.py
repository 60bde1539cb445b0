"""Messages of the outbox, which sends results to other systems."""

from station.messages.message import Nested, Number, define, define_plural

SILENT = define("outbox.silent", "the outbox's process has not reported for {age_s} s", age_s=Number(0))
WAITING = define_plural(
    "outbox.waiting",
    "{destination}: {number} entry waits, for {age_s} s",
    "{destination}: {number} entries wait, for {age_s} s",
    "number",
    age_s=Number(0),
)
WAITING_UNKNOWN = define(
    "outbox.waiting_unknown",
    "{destination}: it is not known how many entries wait, for {age_s} s",
    age_s=Number(0),
)
LATE_BECAUSE = define("outbox.late_because", "{late}: {error}", late=Nested(), error=Nested())

# Faults of a destination, and what a person has to do.
FAULT = define("outbox.fault", "outbox: {cause}; {remedy}", cause=Nested(), remedy=Nested())
NOT_YET_CONNECTED = define("outbox.not_yet_connected", "not yet connected")
UNREACHABLE = define("outbox.unreachable", "{destination} at {address}: {error}")
SEE_SERVER = define("outbox.see_server", "see the server and the outbox's settings")
NO_TABLES = define("outbox.no_tables", "{address} has no tables of the station")
LOAD = define("outbox.load", "load {file} there")
NO_RIGHT = define("outbox.no_right", "{address}: user {user} may not write: {error}")
GRANT_ROLE = define("outbox.grant_role", "grant it the role fruit_station")
OTHER_SCHEMA = define(
    "outbox.other_schema", "the database's schema version is {found}, not {expected}", expected=Number()
)
UPDATE_STATION = define("outbox.update_station", "bring this station to the version of the others")
NAME_TAKEN = define("outbox.name_taken", "another process publishes as {station}")
OWN_NAME = define(
    "outbox.own_name",
    "wait a minute where this station was just cut off, else give each station a name of its own: outbox.station",
)
PASSWORD_OPEN = define("outbox.password_open", "{file}: others than its owner can read the password")
CLOSE_PASSWORD = define("outbox.close_password", "chmod 600 {file}")
PASSWORD_UNREADABLE = define("outbox.password_unreadable", "{file}: the password cannot be read: {error}")
NAME_PASSWORD_FILE = define("outbox.name_password_file", "name a text file that it is in")
PASSWORD_EMPTY = define("outbox.password_empty", "{file}: its first line is empty")
WRITE_PASSWORD = define("outbox.write_password", "write the password there")
