"""An audit trail in a folder of the test's own, and the command line that reads it."""

import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from station.records.audit import AuditEntry, append_audit
from station.records.direct_transaction import direct_transaction
from tests.command_line import call


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "home" / "records"


@pytest.fixture
def trail(folder: Path) -> Callable[..., None]:
    """Append some rows."""

    def write(number: int = 5, **of_entry: Any) -> None:
        with direct_transaction(folder) as connection:
            for place in range(number):
                values = {"who": "Ida", "role": "quality", "action": "test.done", "subject": f"thing {place}"}
                append_audit(connection, AuditEntry(**{**values, **of_entry}))

    return write


@pytest.fixture
def station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[int, str]]:
    """Run the command line; return its exit code and its output."""
    monkeypatch.setenv("STATION_HOME", str(tmp_path / "home"))
    return call


@pytest.fixture
def meddle(folder: Path) -> Callable[[str], None]:
    """Change the database behind the trail's back, its triggers away meanwhile, as one with the file in hand can."""

    def change(statement: str) -> None:
        connection = sqlite3.connect(folder / "records.sqlite3")
        query = "SELECT name, sql FROM sqlite_master WHERE type = 'trigger' AND name <> 'audit_told'"
        found = connection.execute(query).fetchall()
        for name, _ in found:
            connection.execute(f"DROP TRIGGER {name}")
        connection.execute(statement)
        for _, text in found:
            connection.execute(text)
        connection.commit()
        connection.close()

    return change
