"""Bits that need no answer of the station: enable, offline, lot latch, clear error, reset counters."""

from plc_interface.handshake.actions import ClearFaults
from plc_interface.handshake.modes import Arming, Lot, Service, Signal
from plc_interface.handshake.state import HANDSHAKE_COUNTERS, Fault
from plc_interface.handshake.work import Row, Work, described, row

silent = described("Fault: PLC's heartbeat lost.", lambda work: work.fault(Fault.PLC_SILENT))
writer_lost = described("Fault: writer lost.", lambda work: work.fault(Fault.WRITER_LOST))
count_loss = described("Count the loss of communication.", lambda work: work.count("count_communication"))
lot_is_good = described(
    "The lot id was written since the start, and is printable ASCII.", lambda work: work.state.inputs.lot is not None
)


def latch(work: Work) -> None:
    """Accept the lot id, start the latch bit's time-out."""
    work.update_journal(lot=work.state.inputs.lot or "")
    work.watch_bit(Signal.LATCH_TIMEOUT)


end_latch = described("Stop the time-out.", lambda work: work.stop(Signal.LATCH_TIMEOUT))
bad_lot = described("Fault: bad lot id.", lambda work: work.fault(Fault.BAD_LOT))
latch_not_reset = described("Fault: latch bit not reset in time.", lambda work: work.fault(Fault.LATCH_NOT_RESET))


def clear(work: Work) -> None:
    """Clear overrun, missed, the last refusal and the faults."""
    state = work.state
    state.overrun = state.missed = False
    state.last_refusal, state.last_refused_id = None, 0
    state.faults = ()
    work.actions.append(ClearFaults())


def reset(work: Work) -> None:
    """Counters to 0, epoch raised."""
    work.state.counters = dict.fromkeys(HANDSHAKE_COUNTERS, 0)
    work.state.reset_utc_ms = work.at.utc_ms
    work.update_journal(epoch=(work.state.journal.epoch + 1) % 2**32)


RELEASED, ARMED = Arming.RELEASED, Arming.ARMED


def _inhibited(mode: Arming) -> tuple[Row, ...]:
    return (
        row(mode, Signal.ENABLE_OFF, to=RELEASED),
        row(mode, Signal.ENABLE_ON),
        row(mode, Signal.PLC_SILENT, silent),
        row(mode, Signal.WRITER_LOST, count_loss),
    )


ARMING_ROWS = (
    *_inhibited(Arming.DISARMED),
    *_inhibited(Arming.WITHDRAWN),
    row(RELEASED, Signal.ENABLE_ON, to=ARMED),
    row(RELEASED, Signal.ENABLE_OFF),
    row(RELEASED, Signal.PLC_SILENT, silent),
    row(RELEASED, Signal.WRITER_LOST, count_loss),
    row(ARMED, Signal.ENABLE_OFF, to=RELEASED),
    row(ARMED, Signal.PLC_SILENT, silent, to=Arming.WITHDRAWN),
    row(ARMED, Signal.WRITER_LOST, writer_lost, to=Arming.WITHDRAWN),
)

LOT_ROWS = (
    row(Lot.OPEN, Signal.LATCH_ON, latch, to=Lot.LATCHED, when=lot_is_good),
    row(Lot.OPEN, Signal.LATCH_ON, bad_lot),
    row(Lot.OPEN, Signal.LATCH_OFF),
    row(Lot.OPEN, Signal.WRITER_LOST),
    row(Lot.LATCHED, Signal.LATCH_OFF, end_latch, to=Lot.OPEN),
    row(Lot.LATCHED, Signal.WRITER_LOST, end_latch, to=Lot.OPEN),
    row(Lot.LATCHED, Signal.LATCH_TIMEOUT, latch_not_reset, to=Lot.OPEN),
)


def _service(mode: Service, off: Service, on: Service) -> tuple[Row, ...]:
    return (
        row(mode, Signal.OFFLINE_ON, to=off),
        row(mode, Signal.OFFLINE_OFF, to=on),
        row(mode, Signal.CLEAR_ON, clear),
        row(mode, Signal.RESET_ON, reset),
        row(mode, Signal.SHUTTING_DOWN, to=Service.ENDING),
    )


SERVICE_ROWS = (
    *_service(Service.IN_SERVICE, Service.OFFLINE, Service.IN_SERVICE),
    *_service(Service.OFFLINE, Service.OFFLINE, Service.IN_SERVICE),
    *_service(Service.ENDING, Service.ENDING, Service.ENDING),
)
