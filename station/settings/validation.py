"""Validation of plain values as a settings model, with all problems."""

import difflib
import json
from collections.abc import Callable
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.model import Settings
from station.settings.problems import FieldError, Problem, SettingsError, WantedError, shortened
from station.settings.problems import Path as Where
from station.settings.schema import Node, expectation, find, found, names, schema_of
from station.settings.yaml_loader import Document

Model = TypeVar("Model", bound=Settings)

Locate = Callable[[Where], tuple[Message, Message]]
"""Returns the place of a value and its name there: `file:line` and `modbus.port`."""


def validated(
    model: type[Model],
    document: Document,
    value: Any,
    locate: Locate,
    earlier: frozenset[tuple[str, ...]] = frozenset(),
) -> Model:
    """Validate plain values: mappings, lists, texts, numbers, truth values and None.

    Args:
        earlier: the places of an earlier version's settings, which `station config migrate` moves or removes.

    Raises:
        SettingsError: all problems.
    """
    problems = list(document.problems)
    try:
        if () not in document.doubtful:
            # As JSON, because strict pydantic then takes a list for a tuple and a text for an enumeration.
            checked = model.model_validate_json(json.dumps(value))
            if not problems:
                return checked
    except ValidationError as error:
        for details in error.errors():
            problems += _problems(details, value, schema_of(model), locate, document.doubtful, earlier)
    raise SettingsError(sorted(dict.fromkeys(problems), key=_line))


def _line(problem: Problem) -> int:
    """Return a problem's line, for sorting; 0 for none."""
    line = problem.place.parameters.get("line")
    return line if isinstance(line, int) else 0


def _problems(
    details: ErrorDetails,
    value: Any,
    root: Node,
    locate: Locate,
    doubtful: frozenset[Where],
    earlier: frozenset[tuple[str, ...]],
) -> list[Problem]:
    """Convert one error of pydantic to problems; none if the loader has reported it already."""
    kind, given, context = details["type"], details["input"], details.get("ctx", {})
    path = _cleaned(details["loc"], value)
    if kind == "missing" and isinstance(path[-1], int):  # one complaint for a list that is too short
        path = path[:-1]
    if any(path[: len(each)] == each for each in doubtful):
        return []
    if kind == "too_short" and len(given) >= context.get("min_length", 0):
        return []  # pydantic counts the good items only; what is wrong with the others it says itself
    cause = context.get("error")
    if isinstance(cause, FieldError):
        return [Problem(*locate(path + inner), expected) for inner, expected in cause.parts]
    if kind == "extra_forbidden" and path in earlier:
        return [Problem(*locate(path), messages.EARLIER_SETTING(name=path[-1]))]
    if kind == "extra_forbidden":
        return [Problem(*locate(path), _unknown(str(path[-1]), names(root, path[:-1])))]
    if isinstance(cause, WantedError):
        wanted = cause.wanted
    else:
        node = find(root, path)
        wanted = expectation(node, root) if node else messages.ANOTHER_VALUE(type=kind)
    is_missing = kind == "missing" and not isinstance(given, list)
    got = messages.NOTHING() if is_missing else found(given)
    return [Problem(*locate(path), messages.EXPECTED(wanted=wanted, found=got))]


def _cleaned(location: Where, value: Any) -> Where:
    """Return a path without the names of alternatives that pydantic inserts; the value may lack its last part."""
    path: list[str | int] = []
    for index, part in enumerate(location):
        entries: dict[str | int, Any] = value if isinstance(value, dict) else {}
        if isinstance(value, list):
            entries = dict(enumerate(value))
        if part in entries or (index == len(location) - 1 and isinstance(value, dict | list)):
            path.append(part)
            value = entries.get(part)
    return tuple(path)


def _unknown(name: str, known: list[str]) -> Message:
    """Describe an unknown key, with a similar known one or all of them."""
    near = difflib.get_close_matches(name, known, n=1)
    if near:
        return messages.UNKNOWN_KEY_NEAR(name=shortened(name), near=near[0])
    return messages.UNKNOWN_KEY(name=shortened(name), known=", ".join(known))
