"""pytest plugin: the tests that share a whole station stay with one of xdist's workers, which starts it once."""

import pytest
from xdist.remote import Producer
from xdist.scheduler.loadscope import LoadScopeScheduling

STATIONS = ("hmi", "hmi_pages")
"""Folders of tests that share one."""


class Together(LoadScopeScheduling):
    """Scheduling by test, but by folder where tests share a station."""

    def _split_scope(self, nodeid: str) -> str:
        return next((folder for folder in STATIONS if nodeid.startswith(f"tests/{folder}/")), nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> Together:
    """Take the place of the scheduling that `--dist` names."""
    return Together(config, log)
