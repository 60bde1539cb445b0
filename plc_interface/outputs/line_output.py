"""Line outputs: the action on an outcome beside the registers, none or the reject gate; it neither waits nor raises."""

import asyncio
import logging
from collections.abc import Mapping
from pathlib import Path

from plc_interface.outputs.can.counts import ahead
from plc_interface.outputs.can.errors import (
    EchoMissingError,
    GateFullError,
    InterfaceError,
    LineIoError,
    NotReadyError,
    RejectLostError,
    RejectRefusedError,
)
from plc_interface.outputs.can.line_io import LineIo
from plc_interface.outputs.pending_rejects_file import PendingRejectFile
from station.channel.line import LineFault, Outcome
from station.messages import can as messages
from station.settings.can import CanSettings

REJECTS_LANE = 1
"""The gate's lane for all rejects."""
_PLACES = 8
"""Orders that the gate stores at a time."""
_RETRY_S = 0.05
"""Pause before a reject is ordered again. An estimate."""

log = logging.getLogger(__name__)


class NoOutput:
    """No output: the line's PLC diverts."""

    ready = True
    faults: tuple[LineFault, ...] = ()
    counters: Mapping[str, int] = {}

    async def start(self) -> None:
        """Do nothing."""

    async def stop(self) -> None:
        """Do nothing."""

    def publish(self, outcome: Outcome) -> None:
        """Do nothing: the PLC reads the outcome."""

    def renew_health(self, valid_s: float) -> None:
        """Do nothing."""

    def acknowledge_faults(self) -> None:
        """Do nothing."""

    def encoder_count(self) -> int | None:
        """Return None: the PLC has its own encoder."""
        return None


class RejectGate:
    """Reject gate: diverts every fruit that is not surely good, at the count at which it reaches the gate.

    An order is repeated after a loss of the gate, the bus or this process, as long as its count is ahead: the gate
    takes a repeated order for the same one, and does not actuate at a count that is past.
    """

    def __init__(self, settings: CanSettings, folder: Path) -> None:
        """Restore the pending rejects of the run before, from the journal's folder."""
        self._io, self._farthest = LineIo(settings), settings.distance_counts + settings.tolerance_counts
        self._real = settings.real_bus
        self._file = PendingRejectFile(folder)
        self._due = self._file.read()
        self._rejects: dict[int, asyncio.Task[None]] = {}
        self.renew_health = self._io.renew_health
        self.acknowledge_faults = self._io.acknowledge_faults

    async def start(self) -> None:
        """Start bringing up the bus, and order the pending rejects."""
        await self._io.start()
        self._order_next()

    async def stop(self) -> None:
        """Stop the heartbeat: the gate sets its safe output. The next run orders the pending rejects."""
        ordered = list(self._rejects.values())
        for pending in ordered:
            pending.cancel()
        await asyncio.gather(*ordered, return_exceptions=True)
        await self._io.stop()

    def publish(self, outcome: Outcome) -> None:
        """Order a reject actuation for what may not go on. An outcome may come again after a restart."""
        if not self._may_go_on(outcome) and outcome.sequence not in self._due:
            self._due[outcome.sequence] = self._io.count_at_gate(outcome.encoder)
            # In this file before the caller's journal has the outcome, which is then not forwarded again.
            self._file.write(self._due)
            self._order_next()

    def _may_go_on(self, outcome: Outcome) -> bool:
        """Return whether it is a sure PASS, as for the function block; a simulated one is for the twin's gate only."""
        sure = outcome.outcome == "PASS" and not outcome.late and outcome.area_mm2 is not None
        return sure and not (outcome.simulated and self._real)

    def _order_next(self) -> None:
        """Order the rejects that reach the gate next, as many as it has places; the others wait for a free one."""
        # Not all of them, for a fruit behind could take the place that the next one needs.
        first = next(iter(self._due.values()), 0)
        in_order = sorted(self._due.items(), key=lambda reject: ahead(first, reject[1]))
        for sequence, at_count in in_order[:_PLACES]:
            if sequence not in self._rejects:
                pending = asyncio.create_task(self._divert(sequence, at_count), name=f"reject {sequence}")
                self._rejects[sequence] = pending
                pending.add_done_callback(lambda _, sequence=sequence: self._rejects.pop(sequence))

    async def _divert(self, sequence: int, at_count: int) -> None:
        logged = ""
        while not self._is_too_far(sequence, at_count):
            try:
                await self._io.divert(sequence, REJECTS_LANE, at_count)
            except (NotReadyError, InterfaceError, EchoMissingError, RejectLostError, GateFullError) as error:
                if logged != (logged := type(error).__name__):
                    log.warning(
                        "inspection %d: %s; its reject is ordered again until its count is past", sequence, error
                    )
                await asyncio.sleep(_RETRY_S)
                continue
            except LineIoError as error:
                log.warning("inspection %d was not diverted by CAN: %s", sequence, error)
            break
        del self._due[sequence]
        self._file.write(self._due)
        self._order_next()

    def _is_too_far(self, sequence: int, at_count: int) -> bool:
        count = self._io.encoder_count()
        # No fruit is further from the gate than the nest; on a belt that stops, an encoder may count back a little.
        if count is None or ahead(count, at_count) <= self._farthest:
            return False
        error = RejectRefusedError(sequence, messages.COUNT_TOO_FAR(at_count=at_count, now_count=count))
        log.warning("inspection %d was not diverted by CAN: %s", sequence, error)
        self._io.give_up(error)
        return True

    @property
    def ready(self) -> bool:
        """True if a fruit that may not go on would be diverted; else no inspection is started."""
        return self._io.ready

    def encoder_count(self) -> int | None:
        """Return the last count of the encoder on the bus; None if the PLC's is to be used."""
        return self._io.encoder_count()

    @property
    def faults(self) -> tuple[LineFault, ...]:
        """Return the faults of the bus, its nodes and recent reject actuations."""
        return (
            *(LineFault(part="can", what=fault) for fault in self._io.bus_faults),
            *(LineFault(part="reject", what=fault) for fault in self._io.reject_faults),
        )

    @property
    def counters(self) -> Mapping[str, int]:
        """Return the bus's counters, by names that the register map does not have."""
        return {f"can_{name}": count for name, count in self._io.counters.items()}


LineOutput = NoOutput | RejectGate
"""What the interface gives every outcome to; a further output has the methods of `RejectGate`, and is added here."""


def make_output(settings: CanSettings, folder: Path) -> LineOutput:
    """Make the outputs that the settings name; the journal's folder holds the pending rejects."""
    return RejectGate(settings, folder) if settings.enabled else NoOutput()
