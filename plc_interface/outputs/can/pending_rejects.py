"""Pending rejects: ordered reject actuations and the gate's reports of them. Lives on the loop; no bus, no clock."""

import asyncio
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import NamedTuple

from plc_interface.outputs.can.counts import ahead
from plc_interface.outputs.can.errors import (
    EchoWrongError,
    GateFullError,
    LateRejectError,
    RejectError,
    RejectLostError,
    RejectRefusedError,
)
from plc_interface.outputs.can.link import Report
from station.messages import can as messages
from station.messages.message import Message

_REMEMBERED = 64
"""Number of ended orders whose further reports count as late, and not as those of another master. An estimate."""
_KEPT_FAULTS = 8
"""Maximum number of stored faults; the oldest is dropped. An estimate."""
_WIRE = 0xFFFF


class Fired(IntEnum):
    """The gate's report of a reject actuation, object 2001:02 of its data sheet."""

    ARMED = 0
    FIRED = 1
    LATE = 2
    FULL = 3
    BAD = 4


class Order(NamedTuple):
    """One ordered reject actuation."""

    sequence: int
    lane: int
    at_count: int

    @property
    def on_wire(self) -> int:
        """The sequence that the gate gets: the lower 16 bits."""
        return self.sequence & _WIRE


class DivertEcho(NamedTuple):
    """A reject actuation that the gate has carried out as ordered."""

    sequence: int
    lane: int
    at_count: int
    fired_count: int
    """The encoder's count as the gate fired."""
    confirmed_s: float
    """From the order to the gate's confirmation that it is armed."""


class PendingReject:
    """One ordered reject actuation, with the gate's reports of it."""

    def __init__(self, order: Order, tolerance_counts: int) -> None:
        self.order = order
        self._tolerance_counts = tolerance_counts
        self.reports: asyncio.Queue[Report | RejectError] = asyncio.Queue()

    async def next(self) -> Report:
        """Return the gate's next report, if it is that of an order which proceeds as it should.

        Raises:
            RejectError: it was refused, differs from the order, or the gate is lost.
        """
        report = await self.reports.get()
        if isinstance(report, RejectError):
            raise report
        sequence, at = self.order.sequence, self.order.at_count
        match report.fired:
            case Fired.ARMED:
                return report
            case Fired.FIRED:
                off = ahead(at, report.encoder_count)
                if abs(off) > self._tolerance_counts:
                    fired = messages.FIRED_LATE if off > 0 else messages.FIRED_EARLY
                    raise EchoWrongError(sequence, fired(counts=abs(off), at_count=at))
                return report
            case Fired.LATE:
                raise LateRejectError(sequence, messages.ORDER_LATE(at_count=at, now_count=report.encoder_count))
            case Fired.FULL:
                raise GateFullError(sequence, messages.GATE_FULL())
            case _:
                raise RejectRefusedError(sequence, messages.LANE_REFUSED(lane=self.order.lane, answer=report.fired))


class PendingRejects:
    """All pending rejects, by the sequence on the wire."""

    def __init__(self, counters: Counter[str], tolerance_counts: int) -> None:
        self._counters = counters
        self._tolerance_counts = tolerance_counts
        self._pending: dict[int, PendingReject] = {}
        self._ended: deque[int] = deque(maxlen=_REMEMBERED)
        self.faults: deque[Message] = deque(maxlen=_KEPT_FAULTS)
        """Failed reject actuations since the last acknowledgement."""

    @contextmanager
    def under_way(self, order: Order) -> Iterator[PendingReject]:
        """Expect reports of this order; a failure is counted and stored as a fault, but not that the gate is full.

        Raises:
            RejectRefusedError: an order with this sequence is pending.
        """
        if order.on_wire in self._pending:
            raise RejectRefusedError(order.sequence, messages.ORDERED_TWICE())
        pending = self._pending[order.on_wire] = PendingReject(order, self._tolerance_counts)
        try:
            yield pending
        except GateFullError:
            raise  # no fault: there is time to repeat the order until its count is past
        except RejectError as error:
            self.blame(error)
            raise
        finally:
            del self._pending[order.on_wire]
            self._ended.append(order.on_wire)

    def blame(self, error: RejectError) -> None:
        """Count a failed reject actuation, and store it as a fault."""
        self._counters["shots_failed"] += 1
        self.faults.append(error.message)

    def on_report(self, report: Report) -> None:
        """Assign a report of the gate to its order."""
        if pending := self._pending.get(report.sequence):
            pending.reports.put_nowait(report)
        elif report.sequence in self._ended:
            self._counters["echoes_late"] += 1
        else:
            self._counters["echoes_unknown"] += 1
            self.faults.append(messages.UNORDERED_REPORT(sequence=report.sequence))

    def lose(self, why: Message) -> None:
        """End all orders: the gate is lost, and its actions are unknown."""
        for pending in self._pending.values():
            lost = RejectLostError(pending.order.sequence, messages.GATE_LOST(why=why))
            pending.reports.put_nowait(lost)
