"""Bits that need no answer of the station: enable, offline, lot latch, clear error, reset counters."""

from plc_interface.handshake.actions import ClearFaults
from plc_interface.handshake.modes import Arming, Lot, Service, Signal
from plc_interface.handshake.state import COUNTERS, Fault
from plc_interface.handshake.work import Row, Work, row


def silent(work: Work) -> None:
    """Fault: PLC's heartbeat lost."""
    work.fault(Fault.PLC_SILENT)


def writer_lost(work: Work) -> None:
    """Fault: writer lost."""
    work.fault(Fault.WRITER_LOST)


def count_loss(work: Work) -> None:
    """Count the loss of communication."""
    work.count("count_communication")


def lot_is_good(work: Work) -> bool:
    """The lot id is printable ASCII."""
    return work.state.inputs.lot is not None


def latch(work: Work) -> None:
    """Accept the lot id, start the latch bit's time-out."""
    work.update_journal(lot=work.state.inputs.lot or "")
    work.start(Signal.LATCH_TIMEOUT, work.settings.handshake_timeout_s)


def end_latch(work: Work) -> None:
    """Stop the time-out."""
    work.stop(Signal.LATCH_TIMEOUT)


def bad_lot(work: Work) -> None:
    """Fault: bad lot id."""
    work.fault(Fault.BAD_LOT)


def latch_not_reset(work: Work) -> None:
    """Fault: latch bit not reset in time."""
    work.fault(Fault.LATCH_NOT_RESET)


def clear(work: Work) -> None:
    """Clear overrun, missed, the last refusal and the faults."""
    state = work.state
    state.overrun = state.missed = False
    state.last_refusal, state.last_refused_id = None, 0
    state.faults = ()
    work.actions.append(ClearFaults())


def reset(work: Work) -> None:
    """Counters to 0, epoch raised."""
    work.state.counters = dict.fromkeys(COUNTERS, 0)
    work.state.reset_utc_ms = work.at.utc_ms
    work.update_journal(epoch=(work.state.journal.epoch + 1) % 2**32)


DISARMED, RELEASED, ARMED = Arming.DISARMED, Arming.RELEASED, Arming.ARMED

ARMING_ROWS = (
    row(DISARMED, Signal.ENABLE_OFF, to=RELEASED),
    row(DISARMED, Signal.ENABLE_ON),
    row(DISARMED, Signal.PLC_SILENT, silent),
    row(DISARMED, Signal.WRITER_LOST, count_loss),
    row(RELEASED, Signal.ENABLE_ON, to=ARMED),
    row(RELEASED, Signal.ENABLE_OFF),
    row(RELEASED, Signal.PLC_SILENT, silent),
    row(RELEASED, Signal.WRITER_LOST, count_loss),
    row(ARMED, Signal.ENABLE_OFF, to=RELEASED),
    row(ARMED, Signal.PLC_SILENT, silent, to=DISARMED),
    row(ARMED, Signal.WRITER_LOST, writer_lost, to=DISARMED),
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


def _service(mode: Service) -> tuple[Row, ...]:
    return (
        row(mode, Signal.OFFLINE_ON, to=Service.OFFLINE),
        row(mode, Signal.OFFLINE_OFF, to=Service.IN_SERVICE),
        row(mode, Signal.CLEAR_ON, clear),
        row(mode, Signal.RESET_ON, reset),
    )


SERVICE_ROWS = (*_service(Service.IN_SERVICE), *_service(Service.OFFLINE))
