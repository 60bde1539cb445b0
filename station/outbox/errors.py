"""Outbox errors."""

from station.errors import StationError


class OutboxError(StationError):
    """Another system cannot be reached now; its events are published later, in order.

    Args:
        cause: the fault.
        remedy: what a person has to do.
    """

    def __init__(self, cause: str, remedy: str) -> None:
        super().__init__(f"outbox: {cause}; {remedy}")
