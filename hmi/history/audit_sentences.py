"""Rows of the audit trail as sentences in the reader's language; their stored JSON is in `station audit show`."""

import json
import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from hmi.past.past import AuditRow
from hmi.web.text import texts
from hmi.web.translation import NO_VALUE, Locale
from station.messages import alarms, calibration
from station.messages.alarms import AlarmTexts

_MOST_DETAILS = 6
_REVISION = re.compile(r"(\S+) revision (\d+)")
_LONGEST_VALUE = 60
_NO_DETAILS = frozenset({"argument", "done", "why", "text", "sha256", "configuration_sha256", "boot", "file", "status"})
"""Values that the sentence states, or that only a program compares."""
_BALL_RUNS = {"calibration": calibration.A_CALIBRATION, "verification": calibration.A_VERIFICATION}
_ALARMS = {name.lower(): value for name, value in vars(alarms).items() if isinstance(value, AlarmTexts)}


class Sentence(NamedTuple):
    """One row for a reader."""

    who: str
    what: str
    details: tuple[str, ...]
    """Why a command was not done, and what changed, each as `name: old → new`."""


def sentence(row: AuditRow, fruit: Mapping[int, str], locale: Locale) -> Sentence:
    """Write a row as a sentence, with the recipes' titles by their PLC numbers."""
    old, new = _mapping(row.old), _mapping(row.new)
    argument = new.get("argument", 0)
    values = {
        "subject": _subject(row, locale),
        "argument": argument,
        "fruit": locale.title(fruit.get(argument, str(argument))),
    }
    key = f"audit.{row.action}"
    what = locale.text(key, **values) if key in texts() else f"{row.action}: {row.subject}"
    why = (locale.text("audit.not_done", why=new.get("why", "")),) if new.get("done") is False else ()
    return Sentence(_who(row, locale), what, (*why, *_changes(old, new)))


def _who(row: AuditRow, locale: Locale) -> str:
    role = locale.own(f"role.{row.role}", locale.own(f"audit.role.{row.role}", row.role))
    return role if row.who == row.role else f"{row.who}, {role}"


def _subject(row: AuditRow, locale: Locale) -> str:
    kind, _, rest = row.subject.partition(" ")
    if kind == "alarm" and (known := _ALARMS.get(rest)):
        return locale.sentence(known.cause())
    if row.action.startswith("calibration.") and row.subject in _BALL_RUNS:
        return locale.sentence(_BALL_RUNS[row.subject]())
    if kind == "recipe" and (revision := _REVISION.fullmatch(rest)):
        return locale.text("audit.recipe_revision", name=revision[1], n=revision[2])
    return rest if kind in {"recipe", "lot"} and rest else row.subject


def _changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what differs; of a command, whose new values are its own, what was there before."""
    found = []
    for name in dict.fromkeys((*old, *new)):
        before, after = old.get(name), new.get(name)
        if name in _NO_DETAILS or before == after:
            continue
        values = (_written(value) for value in ((before,) if name not in new else (before, after)) if value is not None)
        if shown := " → ".join(values):
            found.append(f"{name.replace('_', ' ')}: {shown}")
    return tuple(found[:_MOST_DETAILS])


def _written(value: Any) -> str:
    match value:
        case None:
            return NO_VALUE
        case list():
            text = ", ".join(map(_written, value))
        case dict():
            text = ", ".join(f"{name} {_written(inner)}" for name, inner in value.items())
        case _:
            text = str(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[:_LONGEST_VALUE]}…"


def _mapping(text: str | None) -> dict[str, Any]:
    try:
        value = json.loads(text) if text else {}
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {"value": value}
