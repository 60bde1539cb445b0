"""Pending rejects: ordered reject actuations and the gate's reports of them. Lives on the loop; no bus, no clock."""

import asyncio
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum
from typing import NamedTuple

from plc_interface.can.counts import ahead
from plc_interface.can.errors import (
    EchoWrongError,
    LateRejectError,
    RejectError,
    RejectLostError,
    RejectRefusedError,
)
from plc_interface.can.link import Report

_REMEMBERED = 64
_KEPT_FAULTS = 8
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
    """A pending reject."""

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
                    raise EchoWrongError(
                        sequence,
                        f"the gate fired {abs(off)} counts {'after' if off > 0 else 'before'} count {at}; "
                        "look at the encoder and at can.tolerance_counts",
                    )
                return report
            case Fired.LATE:
                raise LateRejectError(
                    sequence,
                    f"count {at} was past when the gate got the order, at {report.encoder_count}; "
                    "the fruit went by: raise can.distance_counts or shorten the inspection",
                )
            case Fired.FULL:
                raise RejectRefusedError(sequence, "the gate has no place left for an order; slow the line down")
            case _:
                raise RejectRefusedError(
                    sequence, f"the gate does not take lane {self.order.lane} (answer {report.fired}); look at the lane"
                )


class PendingRejects:
    """All pending rejects, by the sequence on the wire."""

    def __init__(self, counters: Counter[str], tolerance_counts: int) -> None:
        self._counters = counters
        self._tolerance_counts = tolerance_counts
        self._pending: dict[int, PendingReject] = {}
        self._ended: deque[int] = deque(maxlen=_REMEMBERED)
        self.faults: deque[str] = deque(maxlen=_KEPT_FAULTS)
        """Failed reject actuations since the last acknowledgement, one sentence each."""

    @contextmanager
    def under_way(self, order: Order) -> Iterator[PendingReject]:
        """Expect reports of this order; a failure is counted and stored as a fault.

        Raises:
            RejectRefusedError: an order with this sequence is pending.
        """
        if order.on_wire in self._pending:
            raise RejectRefusedError(order.sequence, "it is ordered already; give each shot a sequence of its own")
        pending = self._pending[order.on_wire] = PendingReject(order, self._tolerance_counts)
        try:
            yield pending
        except RejectError as error:
            self.blame(error)
            raise
        finally:
            del self._pending[order.on_wire]
            self._ended.append(order.on_wire)

    def blame(self, error: RejectError) -> None:
        """Count a failed reject actuation, and store it as a fault."""
        self._counters["shots_failed"] += 1
        self.faults.append(str(error))

    def on_report(self, report: Report) -> None:
        """Assign a report of the gate to its order."""
        if pending := self._pending.get(report.sequence):
            pending.reports.put_nowait(report)
        elif report.sequence in self._ended:
            self._counters["echoes_late"] += 1
        else:
            self._counters["echoes_unknown"] += 1
            self.faults.append(
                f"the gate reports shot {report.sequence}, which was not ordered; look for a second master on the bus"
            )

    def lose(self, why: str) -> None:
        """End all orders: the gate is lost, and its actions are unknown."""
        for pending in self._pending.values():
            lost = RejectLostError(
                pending.order.sequence, f"the gate was lost before it reported ({why}); look at the fruit"
            )
            pending.reports.put_nowait(lost)
