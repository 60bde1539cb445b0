"""A flood leaves a few lines and a sum."""

import logging

from hypothesis import given
from hypothesis import strategies as st

from plc_interface.server.log_limit import BURST, REFILL_S, SUMMARY_S, LimitedLog


class Lines(logging.Handler):
    """The messages of a log of its own."""

    def __init__(self):
        super().__init__()
        self.messages = []

    def emit(self, record):
        self.messages.append(record.getMessage())


def limited():
    """A limited log, and its lines."""
    lines, logger = Lines(), logging.getLogger("limited")
    logger.handlers[:] = [lines]
    logger.propagate = False
    logger.setLevel(logging.INFO)
    return LimitedLog(logger), lines


def test_a_flood_is_cut_and_summed_up():
    log, lines = limited()
    for number in range(1000):
        log.write("bad things", 0.001 * number, logging.WARNING, "%s: %d", "10.0.0.1", number)
    log.write("other things", 1.0, logging.INFO, "still said")
    assert lines.messages == [*(f"10.0.0.1: {number}" for number in range(BURST)), "still said"]
    log.sum_up(1.0)
    assert lines.messages[-1] == f"lines left out: {1000 - BURST} of bad things"
    log.write("bad things", 1.0 + 2.5 * REFILL_S, logging.WARNING, "again")
    assert lines.messages[-1] == "again"


def test_sums_come_seldom_but_the_last_one_comes():
    log, lines = limited()
    for at_s in (0.0, 1.0, SUMMARY_S + 1.0):
        for _ in range(2 * BURST):
            log.write("bad things", at_s, logging.WARNING, "bad")
        log.sum_up(at_s)
    sums = [line for line in lines.messages if line.startswith("lines left out")]
    assert sums == [f"lines left out: {BURST} of bad things", f"lines left out: {4 * BURST - 2} of bad things"]
    log.sum_up(SUMMARY_S + 1.5, last=True)
    assert len([line for line in lines.messages if line.startswith("lines left out")]) == 2
    log.write("bad things", SUMMARY_S + 1.5, logging.WARNING, "bad")
    log.sum_up(SUMMARY_S + 1.6, last=True)
    assert lines.messages[-1] == "lines left out: 1 of bad things"


@given(st.lists(st.floats(0, 100), max_size=300).map(sorted))
def test_no_line_is_lost_without_being_counted(times_s):
    log, lines = limited()
    for at_s in times_s:
        log.write("things", at_s, logging.WARNING, "thing")
    log.sum_up(1000.0)
    written = lines.messages.count("thing")
    left_out = sum(int(line.split()[3]) for line in lines.messages if line.startswith("lines left out"))
    assert written + left_out == len(times_s)
    assert written <= BURST + 100 / REFILL_S
