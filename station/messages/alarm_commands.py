"""Messages of commands on alarms: why one was not done."""

from station.messages.message import Number, define

NORMAL = define("alarm_command.normal", "alarm {alarm} is in its normal state")
REASON_NEEDED = define(
    "alarm_command.reason_needed",
    "a reason is needed: whoever reads the alarms next has to know why this one is hidden",
)
TOO_LONG = define("alarm_command.too_long", "shelving for {asked_s} s: at most {limit_s} s, a shift, are possible")
LATCHED = define("alarm_command.latched", "alarm {alarm} is latched until a person has reset it; it is never hidden")
SHELVED_ALREADY = define("alarm_command.shelved_already", "alarm {alarm} is already shelved until {until} by {who}")
UNKNOWN = define("alarm_command.unknown", "alarm {alarm}: expected an id of docs/alarms.md, as {example}")
SHELVED = define("alarm_command.shelved", "for {duration_s} s by {who}: {reason}", duration_s=Number(0))
