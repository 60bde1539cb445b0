"""The newest lines of the station's log, as the page Maintenance requests them."""

import logging

from station.runtime.rpc import log
from station.runtime.rpc.log import LogRing

LOGGER = logging.getLogger("station.test")


def lines(ring, number, level):
    return [(line.level, line.text) for line in ring.last(number, level)]


def test_the_newest_lines_of_a_level_are_kept_newest_last():
    with LogRing() as ring:
        LOGGER.error("the first")
        LOGGER.warning({"event": "fruit %d", "sequence": 1})
        LOGGER.error("it failed", exc_info=ValueError("no fruit"))
    LOGGER.error("nobody listens any more")
    assert lines(ring, 9, "WARNING") == [
        ("ERROR", "the first"), ("WARNING", "fruit %d"), ("ERROR", "it failed: ValueError: no fruit"),
    ]  # fmt: skip
    assert lines(ring, 1, "ERROR") == [("ERROR", "it failed: ValueError: no fruit")]
    assert lines(ring, 9, "CRITICAL") == []
    newest = ring.last(1, "ERROR")[0]
    assert (newest.logger, newest.utc_ms > 1.7e12) == ("station.test", True)


def test_old_lines_give_way_and_long_ones_are_cut(monkeypatch):
    monkeypatch.setattr(log, "STORED_LINES", 3)
    with LogRing() as ring:
        for number in range(5):
            LOGGER.error(f"{number}" * 2000)
    assert [text[:1] for _, text in lines(ring, 9, "ERROR")] == ["2", "3", "4"]
    assert {len(text) for _, text in lines(ring, 9, "ERROR")} == {1000}
