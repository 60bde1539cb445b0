"""Hold: what only a person may end, durable before it is shown and found again by the next start."""

import asyncio
import logging

from station.inspection.cycle import LATCHES, Event, hold_after
from station.inspection.states import State
from station.state_files import StateFiles

FILE_NAME = "held_for_a_person"
_NONE = b"no"
_DEADLINE_S = 1.0
"""Longest wait for the disk, s: an estimate. A slower write goes on in the background."""
_HOLDS = {event.encode(): event for event in (Event.FRUIT_HELD, *LATCHES)}

log = logging.getLogger(__name__)


class Hold:
    """The event that the next start begins with, in a file. A file that cannot be read counts as a held fruit."""

    def __init__(self, state_files: StateFiles, *, carries: bool) -> None:
        self._files, self._carries = state_files, carries
        self._turn = asyncio.Lock()
        self._late: set[asyncio.Task[None]] = set()
        data = _NONE if state_files.is_missing(FILE_NAME) else state_files.read(FILE_NAME)
        self.event = None if data == _NONE else _HOLDS.get(data or b"", Event.FRUIT_HELD)
        """None where no person is needed."""

    def changes(self, event: Event, state: State) -> bool:
        """Note the hold of a state that an event leads to. Whether it has to be stored before the state is shown."""
        before = self.event
        self.event = hold_after(event, state, before, carries=self._carries)
        return self.event is not before

    async def store(self) -> None:
        """Make the hold durable. A disk that refuses or hangs is logged; the wait for it is short."""
        storing = asyncio.create_task(self._store(), name="hold's file")
        await asyncio.wait({storing}, timeout=_DEADLINE_S)
        if not storing.done():
            log.warning(
                "the disk is slow: if the process is killed now, the next start does not know of %s",
                self.event or "the end of the hold",
            )
            # The event loop has only weak references to its tasks.
            self._late.add(storing)
            storing.add_done_callback(self._late.discard)

    async def _store(self) -> None:
        async with self._turn:
            # In its turn, and of the event as it is then: a slow write cannot bring an older hold back.
            await asyncio.to_thread(self._files.write, FILE_NAME, _NONE if self.event is None else self.event.encode())
