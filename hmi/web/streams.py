"""Event stream of one page, as a holder of a place; see `station.serving.places`."""

import asyncio
import time

MOST_STREAMS, RESERVED_STREAMS = 100, 100
"""Of all strangers together; of people who are logged in, and of known addresses."""


class Stream:
    """One page's event stream.

    Args:
        holder: the person, or the address where nobody is logged in.
        known: whether it uses the reserve.
    """

    def __init__(self, holder: str, *, known: bool) -> None:
        self.holder, self.known = holder, known
        self.rank: tuple[float, ...] | None = (time.monotonic(),)
        self.displaced: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done once another page has the place."""

    def displace(self) -> None:
        """End: another page has the place."""
        self.displaced.set_result(None)
