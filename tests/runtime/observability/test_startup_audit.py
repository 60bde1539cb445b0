"""A start's audit entries: no secret is in them, and no change of settings is left out."""

import asyncio
import hashlib
from types import SimpleNamespace
from typing import Any

from station.messages.message import verbatim
from station.records.errors import ReadOnlyError
from station.runtime.observability.audit_logger import AuditLogger
from station.runtime.observability.startup_audit import start_entries
from station.state_files import StateFiles


def test_a_secret_is_audited_by_a_keyed_hash(tmp_path):
    def changed(folder, secret) -> Any:
        configuration: Any = SimpleNamespace(model_dump=lambda **_: {"mqtt": {"password": secret}})
        entries, confirm = start_entries("boot", configuration, StateFiles(folder), {}, "")
        assert confirm()
        return entries[1] if len(entries) > 1 else None

    assert changed(tmp_path / "one", "1234") is None
    assert changed(tmp_path / "one", "1234") is None, "the key stays"
    entry = changed(tmp_path / "one", "5678")
    assert hashlib.sha256(b"5678").hexdigest()[:16] not in str(entry)
    assert entry.new["mqtt.password"].startswith("hmac-sha256 ")
    changed(tmp_path / "other", "1234")
    assert changed(tmp_path / "other", "5678").new != entry.new


def test_a_change_that_the_trail_could_not_take_is_in_that_of_a_later_start(tmp_path):
    rows: list[Any] = []

    async def audit(entry):
        if not writable:
            raise ReadOnlyError(verbatim("read-only"), verbatim("make it writable"))
        rows.append(entry)

    async def start(width_mm):
        configuration: Any = SimpleNamespace(model_dump=lambda **_: {"width_mm": width_mm})
        trail: Any = SimpleNamespace(audit=audit)
        logger = AuditLogger(trail)
        entries, confirm = start_entries("boot", configuration, StateFiles(tmp_path), {}, "")
        logger.log(*entries, on_stored=lambda: asyncio.to_thread(confirm))
        await logger.flush()

    for width_mm, writable in ((1, True), (2, False), (3, True), (3, True)):  # noqa: B007 (`audit` reads it)
        asyncio.run(start(width_mm))
    changes = [(row.old, row.new) for row in rows if row.action == "settings.changed"]
    assert changes == [({"width_mm": 1}, {"width_mm": 3})]
