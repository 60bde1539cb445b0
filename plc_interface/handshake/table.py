"""The state table: rows of every region, and the selection of a row."""

from collections import defaultdict

from plc_interface.handshake import bits, commands, inspection, link, results, trigger
from plc_interface.handshake.modes import Arming, Command, Inspection, Link, Lot, Mode, Result, Service, Signal, Trigger
from plc_interface.handshake.work import Row, Work

REGIONS: dict[type[Mode], tuple[Row, ...]] = {
    Link: link.ROWS,
    Service: bits.SERVICE_ROWS,
    Arming: bits.ARMING_ROWS,
    Lot: bits.LOT_ROWS,
    Result: results.ROWS,
    Command: commands.ROWS,
    Inspection: inspection.ROWS,
    Trigger: trigger.ROWS,
}
"""By region, in the order in which they take a signal that concerns several."""

_CONCERNED: dict[Signal, tuple[type[Mode], ...]] = {
    signal: tuple(region for region, rows in REGIONS.items() if any(row.signal is signal for row in rows))
    for signal in Signal
}

_ROWS: dict[tuple[type[Mode], Mode, Signal], list[Row]] = defaultdict(list)
for _region, _rows in REGIONS.items():
    for _row in _rows:
        _ROWS[_region, _row.mode, _row.signal].append(_row)


def apply(work: Work, signal: Signal) -> None:
    """Apply a signal to every region that has a row for it; a pair without a row changes nothing."""
    for region in _CONCERNED[signal]:
        mode = work.state.mode(region)
        for row in _ROWS.get((region, mode, signal), ()):
            if row.guard is None or row.guard(work):
                for effect in row.effects:
                    effect(work)
                setattr(work.state, region.__name__.lower(), row.next)
                break
        else:
            work.state.unlisted += 1
            work.log(f"{region.__name__.lower()} is {mode}, and then {signal}: not foreseen, nothing was done")
