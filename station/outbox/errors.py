"""Outbox errors."""

from station.errors import StationError
from station.messages.message import Message
from station.messages.outbox import FAULT


class OutboxError(StationError):
    """Another system cannot be reached now, for a cause with a remedy; its events are published later, in order."""

    def __init__(self, cause: Message, remedy: Message) -> None:
        super().__init__(FAULT(cause=cause, remedy=remedy))
