"""A real Prometheus and PostgreSQL, or a word on what is missing."""

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from benchmarks.archive import postgres
from benchmarks.monitoring import prometheus


def _missing(what: str) -> None:
    if os.environ.get("CI") == "true":
        pytest.fail(f"{what} is missing, and CI=true says that nothing may be", pytrace=False)
    pytest.skip(f"{what} is missing on this machine")


@pytest.fixture
def promtool() -> Any:
    """Runs promtool; raises where it complains."""
    if shutil.which("promtool") is None or shutil.which("prometheus") is None:
        _missing("prometheus")
    return prometheus.promtool


@pytest.fixture
def postgresql_programs() -> Path:
    """Where PostgreSQL's server programs lie."""
    programs = postgres.programs()
    if programs is None:
        _missing("postgresql")
    assert programs is not None
    return programs
