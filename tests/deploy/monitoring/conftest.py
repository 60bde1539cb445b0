"""A real Prometheus, or a word on what is missing."""

from typing import Any

import pytest

from benchmarks.monitoring import prometheus
from tests.tools import required


@pytest.fixture
def promtool() -> Any:
    """Runs promtool; raises where it complains."""
    required("promtool")
    required("prometheus")
    return prometheus.promtool
