"""Gateway to the station: the HMI's one channel client; requests with deadlines, and periodic polling."""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from typing import Self, TypeVar

from hmi.web.roles import Role
from hmi.web.sessions import Caller
from station.allowance import Allowance
from station.channel.client import ChannelClient
from station.channel.line import Noted
from station.channel.messages import ChannelError, ChannelMessage, DeadlineError, RefusedError
from station.channel.panel import Actor
from station.channel.panel_run import Fruit, GetFruit, GetPanelState, GetRecent, PanelState, PersonNoted, Recent
from station.errors import StationError

ReplyT = TypeVar("ReplyT", bound=ChannelMessage)
STALE_S = 2.0
"""An older state is not shown as live."""
DEADLINE_S = 2.0
"""For a request that the station answers from memory. An estimate."""
SLOW_DEADLINE_S = 20.0
"""For a request that waits for a device or the disk. An estimate."""
ORDER_DEADLINE_S = 5.0
"""For the station to take an operator's command; its end is shown later. An estimate."""
_POLL_DEADLINE_S = 1.0
UNNAMED_BURST, UNNAMED_REFILL_S = 30, 60.0
"""Audit rows that anybody can cause without a log-in: at once, and time for one more."""

log = logging.getLogger(__name__)


class Gateway:
    """Polled state of the station, and requests to it. Belongs to the event loop in which it is entered.

    Args:
        endpoint: the panel's channel.
        period_s: polling period; one poll serves all pages, however many are open.
    """

    def __init__(self, endpoint: str, period_s: float) -> None:
        self._endpoint, self._period_s = endpoint, period_s
        self._client: ChannelClient | None = None
        self._polling: asyncio.Task[None] | None = None
        self._polled: asyncio.Future[None] | None = None
        self._known: tuple[str, int] | None = None
        """The station's start and number of changes that `last` and `recent` are of."""
        self.state: PanelState | None = None
        """The last answer; None before the first."""
        self.heard_s: float | None = None
        """Time of the last answer, monotonic."""
        self.last: Fruit | None = None
        """The last fruit."""
        self.recent = Recent(fruit=())
        """The last fruit in short."""
        self.flooded_by: Callable[[], str] = str
        """Returns the address that floods the pages with connections; empty for none. The station raises its alarm."""
        self._unnamed, self._left_out = Allowance(UNNAMED_BURST, UNNAMED_REFILL_S), 0

    async def __aenter__(self) -> Self:
        self._client = ChannelClient(self._endpoint, "the station")
        self._polling = asyncio.create_task(self._poll(), name="polling the station")
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._polling is not None:
            self._polling.cancel()
            await asyncio.gather(self._polling, return_exceptions=True)
        if self._client is not None:
            await self._client.close()

    @property
    def age_s(self) -> float | None:
        """Age of `state`; None before the first answer."""
        return None if self.heard_s is None else time.monotonic() - self.heard_s

    @property
    def fresh(self) -> bool:
        """True while `state` is recent enough to be shown as live."""
        return self.age_s is not None and self.age_s <= STALE_S

    async def request(self, request: ChannelMessage, reply: type[ReplyT], *, deadline_s: float = DEADLINE_S) -> ReplyT:
        """Send a request to the station and return its answer, within the deadline in all.

        Raises:
            DeadlineError: no answer came in time; of an order it is unknown whether it was carried out.
            RefusedError: the station refused; the message is the station's.
        """
        if self._client is None:
            raise DeadlineError("the channel to the station is not open")
        return await self._client.request(request, reply, deadline_s=deadline_s)

    async def note(self, what: PersonNoted) -> None:
        """Write an event into the audit trail, and into the log if the station does not answer.

        Of events of callers who are not logged in only so many are written; the next row has the number left out.
        """
        if what.person.role == Role.VIEWER:
            if not self._unnamed.take(time.monotonic()):
                self._left_out += 1
                return
            if self._left_out:
                what = what.model_copy(update={"subject": f"{what.subject} ({self._left_out} rows before it left out)"})
                self._left_out = 0
        log.info("%s (%s): %s %s", what.person.who, what.person.role, what.what, what.subject)
        try:
            await self.request(what, Noted)
        except StationError as error:
            log.warning("the audit trail does not have it: %s", error)

    def polled(self) -> asyncio.Future[None]:
        """Return a future that is done at the end of the next poll, with or without an answer."""
        if self._polled is None:
            self._polled = asyncio.get_running_loop().create_future()
        return self._polled

    async def _poll(self) -> None:
        while True:
            began_s = time.monotonic()
            with contextlib.suppress(ChannelError):
                asked = GetPanelState(flooded_by=self.flooded_by())
                state = await self.request(asked, PanelState, deadline_s=_POLL_DEADLINE_S)
                if (newest := (state.boot, state.fruit_changes)) != self._known:
                    self.recent = await self.request(GetRecent(most=200), Recent)
                    self.last, self._known = await self._fruit(state.last_sequence), newest
                self.state, self.heard_s = state, time.monotonic()
            polled, self._polled = self._polled, None
            if polled is not None:
                polled.set_result(None)
            await asyncio.sleep(max(0.01, self._period_s - (time.monotonic() - began_s)))

    async def _fruit(self, sequence: int | None) -> Fruit | None:
        """Return a fruit in full; None if the station has no details of it any more."""
        if sequence is None:
            return None
        with contextlib.suppress(RefusedError):
            return await self.request(GetFruit(sequence=sequence), Fruit)
        return None


def actor_of(caller: Caller) -> Actor:
    """Return the caller as an actor of the audit trail."""
    return Actor(who=caller.name or "panel", role=caller.role)
