"""A real Prometheus and PostgreSQL, or a word on what is missing."""

from pathlib import Path
from typing import Any

import pytest

from benchmarks.archive import postgres
from benchmarks.monitoring import prometheus
from tests.tools import missing, required


@pytest.fixture
def promtool() -> Any:
    """Runs promtool; raises where it complains."""
    required("promtool")
    required("prometheus")
    return prometheus.promtool


@pytest.fixture
def postgresql_programs() -> Path:
    """Where PostgreSQL's server programs lie."""
    return postgres.programs() or missing("postgresql")
