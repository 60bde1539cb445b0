"""What can keep the outbox from telling."""

from station.errors import StationError


class OutboxError(StationError):
    """Another system cannot be told now; it is told later, in order.

    Args:
        cause: what is wrong.
        remedy: what a person does.
    """

    def __init__(self, cause: str, remedy: str) -> None:
        super().__init__(f"outbox: {cause}; {remedy}")
