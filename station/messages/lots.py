"""Messages of lots."""

from station.messages.message import Nested, Number, define

REFUSED = define("lot.refused", "Lot {lot} cannot begin: {why}.", why=Nested())
NAMELESS_REFUSED = define("lot.nameless_refused", "A lot without a name cannot begin: {why}.", why=Nested())
PLC_NAMES = define("lot.plc_names", "the line's PLC names the lots: start and end them there")
BAD_NAME = define(
    "lot.bad_name",
    "{name} is no lot's name: expected 1 to {longest} letters, digits and signs",
    longest=Number(),
)
NONE = define("lot.none", "no lot was started at the panel")
ANOTHER = define("lot.another", "lot {lot} is over, and nothing was ended: lot {now} is under way by now")
START_NOT_STORED = define(
    "lot.start_not_stored",
    "lot {lot} is started, but is lost at the next start: the home folder cannot be written; make it writable",
)
END_NOT_STORED = define(
    "lot.end_not_stored",
    "lot {lot} is ended, but continues at the next start: the home folder cannot be written; make it writable",
)
