"""Counters of the server, since it was made."""

from collections import Counter

from plc_interface.server.exceptions import CONNECTION_TROUBLES, Trouble


class Statistics:
    """Counts that only grow."""

    def __init__(self) -> None:
        self.requests = 0
        """Complete ADUs, with any answer."""
        self.connections = 0
        """Connections that were taken."""
        self.troubles: Counter[Trouble] = Counter()
        """By kind; a kind that never came up reads 0."""

    @property
    def bad_requests(self) -> int:
        """Requests answered with an exception, and malformed ones."""
        return sum(count for trouble, count in self.troubles.items() if trouble not in CONNECTION_TROUBLES)

    @property
    def refused_connections(self) -> int:
        """Connections refused or closed by a limit."""
        return sum(self.troubles[trouble] for trouble in CONNECTION_TROUBLES)
