"""Outbox errors."""

from station.errors import StationError
from station.messages.message import Message
from station.messages.outbox import FAULT


class OutboxError(StationError):
    """Another system cannot be reached now; its events are published later, in order.

    Args:
        cause: the fault.
        remedy: what a person has to do.
    """

    def __init__(self, cause: Message, remedy: Message) -> None:
        super().__init__(FAULT(cause=cause, remedy=remedy))
