"""A start's audit entries tell no secret, not even to who tries all short ones."""

import hashlib
from types import SimpleNamespace
from typing import Any

from station.runtime.observability.startup_audit import start_entries
from station.state_files import StateFiles


def test_a_secret_is_audited_by_a_keyed_hash(tmp_path):
    def changed(folder, secret) -> Any:
        configuration: Any = SimpleNamespace(model_dump=lambda **_: {"mqtt": {"password": secret}})
        entries = start_entries("boot", configuration, StateFiles(folder), {}, "")
        return entries[1] if len(entries) > 1 else None

    assert changed(tmp_path / "one", "1234") is None
    assert changed(tmp_path / "one", "1234") is None, "the key stays"
    entry = changed(tmp_path / "one", "5678")
    assert hashlib.sha256(b"5678").hexdigest()[:16] not in str(entry)
    assert entry.new["mqtt.password"].startswith("hmac-sha256 ")
    changed(tmp_path / "other", "1234")
    assert changed(tmp_path / "other", "5678").new != entry.new
