"""The result block and its acknowledgement by sequence."""

from plc_interface.handshake.modes import Result, Signal
from plc_interface.handshake.outcomes import acknowledge, pass_over_hidden
from plc_interface.handshake.state import Fault
from plc_interface.handshake.work import Work, described, row


def bit_is_high(work: Work) -> bool:
    """The acknowledge bit is high."""
    return "acknowledge" in (work.state.seen or ()) and not work.state.acknowledge_stuck


another_waits = described("Another result waits.", lambda work: len(work.state.queue) > 1)
one_waits = described("A result waits.", lambda work: bool(work.state.queue))


def publish_oldest(work: Work) -> None:
    """Publish the oldest result, toggle."""
    work.state.toggle = not work.state.toggle
    work.state.published = work.state.queue[0].sequence


def take(work: Work) -> None:
    """Remove it from the queue, `Acknowledged`."""
    taken, *rest = work.state.queue
    work.state.queue = tuple(rest)
    work.state.unconfirmed = 0 if bit_is_high(work) else taken.sequence
    acknowledge(work, taken.sequence)
    pass_over_hidden(work)


def take_unwritten(work: Work, sequence: int) -> None:
    """Take what the PLC had taken before a start, also where a full disk left its acknowledgement out of the journal.

    Args:
        work: the PLC's first write.
        sequence: the one in it; what is not known yet is taken once the station reports it. A number that was written
            before its outcome was shown takes none.
    """
    state = work.state
    if sequence == state.journal.disbelieved:
        return
    state.taken = sequence
    if any(outcome.sequence == sequence for outcome in state.queue):
        # Results are published in order: what is older was taken before it.
        state.queue = tuple(outcome for outcome in state.queue if outcome.sequence > sequence)
        state.unconfirmed = 0 if bit_is_high(work) else sequence
        acknowledge(work, sequence)
        pass_over_hidden(work)


watch = described("Start the acknowledge bit's time-out.", lambda work: work.watch_bit(Signal.ACKNOWLEDGE_TIMEOUT))
end_watch = described("Stop the time-out.", lambda work: work.stop(Signal.ACKNOWLEDGE_TIMEOUT))


def enable_bit(work: Work) -> None:
    """The bit is evaluated again."""
    work.state.acknowledge_stuck = False


def not_reset(work: Work) -> None:
    """Fault: acknowledge bit not reset in time; the bit is ignored until it falls."""
    work.state.acknowledge_stuck = True
    work.fault(Fault.ACKNOWLEDGE_NOT_RESET)


wrong = described("Fault: wrong acknowledgement.", lambda work: work.fault(Fault.WRONG_ACKNOWLEDGEMENT))


WITHHELD, EMPTY, PUBLISHED, TAKEN = Result.WITHHELD, Result.EMPTY, Result.PUBLISHED, Result.TAKEN

ROWS = (
    row(WITHHELD, Signal.FIRST_WRITE, publish_oldest, to=PUBLISHED, when=one_waits),
    row(WITHHELD, Signal.FIRST_WRITE, to=EMPTY),
    row(WITHHELD, Signal.QUEUED),
    row(WITHHELD, Signal.WRONG_ACKNOWLEDGEMENT, wrong),
    row(WITHHELD, Signal.WRITER_LOST),
    row(EMPTY, Signal.QUEUED, publish_oldest, to=PUBLISHED),
    row(EMPTY, Signal.ACKNOWLEDGE_AFTER, watch, to=TAKEN),
    row(EMPTY, Signal.WRONG_ACKNOWLEDGEMENT, wrong),
    row(EMPTY, Signal.ACKNOWLEDGE_OFF, enable_bit),
    row(EMPTY, Signal.WRITER_LOST, enable_bit),
    row(PUBLISHED, Signal.ACKNOWLEDGED, take, watch, to=TAKEN, when=bit_is_high),
    row(PUBLISHED, Signal.ACKNOWLEDGED, take, publish_oldest, when=another_waits),
    row(PUBLISHED, Signal.ACKNOWLEDGED, take, to=EMPTY),
    row(PUBLISHED, Signal.ACKNOWLEDGE_AFTER, watch, to=TAKEN),
    row(PUBLISHED, Signal.QUEUED),
    row(PUBLISHED, Signal.WRONG_ACKNOWLEDGEMENT, wrong),
    row(PUBLISHED, Signal.ACKNOWLEDGE_OFF, enable_bit),
    row(PUBLISHED, Signal.WRITER_LOST, enable_bit),
    row(TAKEN, Signal.ACKNOWLEDGED, take),
    row(TAKEN, Signal.QUEUED),
    row(TAKEN, Signal.WRONG_ACKNOWLEDGEMENT, wrong),
    row(TAKEN, Signal.ACKNOWLEDGE_OFF, end_watch, publish_oldest, to=PUBLISHED, when=one_waits),
    row(TAKEN, Signal.ACKNOWLEDGE_OFF, end_watch, to=EMPTY),
    row(TAKEN, Signal.WRITER_LOST, end_watch, publish_oldest, to=PUBLISHED, when=one_waits),
    row(TAKEN, Signal.WRITER_LOST, end_watch, to=EMPTY),
    row(TAKEN, Signal.ACKNOWLEDGE_TIMEOUT, not_reset, publish_oldest, to=PUBLISHED, when=one_waits),
    row(TAKEN, Signal.ACKNOWLEDGE_TIMEOUT, not_reset, to=EMPTY),
)
