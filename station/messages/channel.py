"""Messages of the channels between the station's processes."""

from station.messages.message import Name, Number, define

TOO_LATE = define("channel.too_late", "{request} came after its deadline and was not begun", request=Name())
UNKNOWN_REQUEST = define("channel.unknown_request", "{request} is no request that this process knows", request=Name())
MALFORMED_REQUEST = define("channel.malformed_request", "{request} is malformed: {why}", request=Name(), why=Name())
NO_ANSWER = define(
    "channel.no_answer",
    "{peer} gave no answer within {limit_s} s when asked {purpose}",
    peer=Name(),
    limit_s=Number(),
    purpose=Name(),
)
CHANNEL_CLOSED = define("channel.closed", "the channel to {peer} was closed", peer=Name())
