"""pytest plugin: the tests that share a whole station stay with few of xdist's workers; each starts it once."""

from zlib import crc32

import pytest
from xdist.remote import Producer
from xdist.scheduler.loadscope import LoadScopeScheduling

STATIONS = {"hmi": 2, "hmi_pages": 1}
"""Folders of tests that share one, and with how many workers each stays: one alone had tests/hmi for longer than the
other five had all the rest (257 s, and 228 s each, in round 9)."""


class Together(LoadScopeScheduling):
    """Scheduling by test, but by shares of a folder's files where tests share a station."""

    def _split_scope(self, nodeid: str) -> str:
        for folder, workers in STATIONS.items():
            if nodeid.startswith(f"tests/{folder}/"):
                # Of the name, so that a file is with the same others in each round.
                return f"{folder} {crc32(nodeid.partition('::')[0].encode()) % workers}"
        return nodeid


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Together:
    """Take the place of the scheduling that `--dist` names."""
    return Together(config, log)
