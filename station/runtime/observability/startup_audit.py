"""Audit entries of a start, of its end, and of settings changed between two starts."""

import hashlib
import hmac
import json
import secrets
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from station.records.audit import STATION, AuditEntry
from station.settings.configuration import Configuration
from station.state_files import StateFiles

_LAST = "audited_configuration.json"
_KEY = "audited_configuration.key"
_HIDDEN = ("password", "secret", "token", "pin")
"""Settings with these words in their name are audited by a keyed hash: a short secret cannot be found by trying."""


def start_entries(
    boot: str, configuration: Configuration, state_files: StateFiles, versions: Mapping[str, str], broken: str
) -> tuple[tuple[AuditEntry, ...], Callable[[], bool]]:
    """Make the entries of a start, with the settings that changed since the last audited ones in the state files.

    Args:
        broken: error of the configuration's file; its last good form is in force then.

    Returns:
        The entries, and a function that makes these settings the last audited ones; call it once the audit trail has
        the entries, or a change would be in no trail where this start cannot write it.
    """
    key = state_files.read(_KEY)
    if not key:
        state_files.write(_KEY, key := secrets.token_bytes(32))
    values = dict(_flat(configuration.model_dump(mode="json"), "", key))
    text = json.dumps(values, sort_keys=True)
    before = json.loads(state_files.read(_LAST) or b"null")
    sha256 = hashlib.sha256(text.encode()).hexdigest()
    new = {"boot": boot, "configuration_sha256": sha256, **versions} | ({"broken": broken} if broken else {})
    start = AuditEntry(STATION, STATION, "service.started", "station", "", None, new)

    def confirm() -> bool:
        return state_files.write(_LAST, text.encode())

    if not isinstance(before, dict) or before == values:
        return (start,), confirm
    changed = sorted(name for name in {*before, *values} if before.get(name) != values.get(name))
    old, new = ({name: each.get(name) for name in changed} for each in (before, values))
    change = AuditEntry("configuration", STATION, "settings.changed", "station.yaml or environment", "", old, new)
    return (start, change), confirm


def end_entry(boot: str, *, requested: bool) -> AuditEntry:
    """Make the entry of an end, which was requested or else caused by a failure."""
    return AuditEntry(STATION, STATION, "service.ended", "station", "", None, {"boot": boot, "asked": requested})


def _flat(value: Any, path: str, key: bytes) -> Iterator[tuple[str, Any]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _flat(inner, f"{path}.{name}" if path else str(name), key)
    elif value is not None and any(word in path.rpartition(".")[2] for word in _HIDDEN):
        yield path, f"hmac-sha256 {hmac.new(key, str(value).encode(), hashlib.sha256).hexdigest()[:16]}"
    else:
        yield path, value
