"""Messages of the channels between the station's processes."""

from station.messages.message import define

TOO_LATE = define("channel.too_late", "{request} came after its deadline and was not begun")
UNKNOWN_REQUEST = define("channel.unknown_request", "{request} is no request that this process knows")
MALFORMED_REQUEST = define("channel.malformed_request", "{request} is malformed: {why}")
NO_ANSWER = define("channel.no_answer", "{peer} did not answer {request} within {limit_s} s")
CHANNEL_CLOSED = define("channel.closed", "the channel to {peer} was closed")
