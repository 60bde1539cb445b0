"""Validation of plain values as a settings model, with all problems as text."""

import difflib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from station.settings.model import Settings
from station.settings.problems import Contradiction, Problem, SettingsError, shortened
from station.settings.problems import Path as Where
from station.settings.schema import Node, expectation, find, formatted, names, schema_of
from station.settings.yaml_loader import MOST_PROBLEMS, Document, read_document

Model = TypeVar("Model", bound=Settings)

Locate = Callable[[Where], tuple[str, str]]
"""Says where a value was written and what it is called there: `file:line` and `modbus.port`."""


def load_file(model: type[Model], path: Path) -> Model:
    """Read a YAML file into a model.

    Args:
        model: the expected content.
        path: the file.

    Raises:
        SettingsError: all problems of the file, in the order of its lines.
    """
    document = read_document(path)
    return validated(model, document, document.value, document.locate)


def validated(model: type[Model], document: Document, value: Any, locate: Locate) -> Model:
    """Validate plain values.

    Args:
        model: the expected model.
        document: the source file; its own problems come first.
        value: mappings, lists, texts, numbers, truth values and None.
        locate: returns the place of a value in the source.

    Raises:
        SettingsError: all problems.
    """
    problems = list(document.problems)
    if () in document.doubtful:
        raise SettingsError(problems)
    try:
        # As JSON, because strict pydantic then takes a list for a tuple and a text for an enumeration.
        checked = model.model_validate_json(json.dumps(value))
    except ValidationError as error:
        for details in error.errors():
            if len(problems) > MOST_PROBLEMS:
                break
            problems += _problems(details, value, schema_of(model), locate, document.doubtful)
        raise SettingsError(_readable(sorted(dict.fromkeys(problems), key=_line))) from error
    if problems:
        raise SettingsError(problems)
    return checked


def _readable(problems: list[Problem]) -> list[Problem]:
    """Limit the number of problems to a readable one."""
    if len(problems) <= MOST_PROBLEMS:
        return problems
    more = Problem(problems[MOST_PROBLEMS].place, "file", "and more: mend these first")
    return [*problems[:MOST_PROBLEMS], more]


def _line(problem: Problem) -> int:
    """Return a problem's line, for sorting; 0 for none."""
    line = problem.place.rpartition(":")[2]
    return int(line) if line.isdecimal() else 0


def _problems(
    details: ErrorDetails, value: Any, root: Node, locate: Locate, doubtful: frozenset[Where]
) -> list[Problem]:
    """Convert one error of pydantic to problems; none if the loader has reported it already."""
    path = _cleaned(details["loc"], value)
    if details["type"] == "missing" and isinstance(path[-1], int):  # one complaint for a list that is too short
        path = path[:-1]
    if any(path[: len(each)] == each for each in doubtful):
        return []
    if details["type"] == "too_short" and len(details["input"]) >= details.get("ctx", {}).get("min_length", 0):
        return []  # pydantic counts the good items only; what is wrong with the others it says itself
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, Contradiction):
        return [Problem(*locate(path + inner), text) for inner, text in cause.parts]
    return [Problem(*locate(path), _difference(details, path, root, cause))]


def _cleaned(location: tuple[str | int, ...], value: Any) -> Where:
    """Return a path without the names of alternatives that pydantic inserts; the value may lack its last part."""
    path: list[str | int] = []
    for index, part in enumerate(location):
        inside = _inside(value, part)
        if inside is not None:
            path.append(part)
            value = inside[0]
        elif index == len(location) - 1 and isinstance(value, dict | list):
            path.append(part)
    return tuple(path)


def _inside(value: Any, part: str | int) -> tuple[Any] | None:
    """Return one entry or item, or None if there is none."""
    if isinstance(value, dict) and part in value:
        return (value[part],)
    if isinstance(value, list) and isinstance(part, int) and part < len(value):
        return (value[part],)
    return None


def _difference(details: ErrorDetails, path: Where, root: Node, cause: object) -> str:
    """Describe the expected and the actual value."""
    if details["type"] == "extra_forbidden":
        return _unknown(str(path[-1]), names(root, path[:-1]))
    node = find(root, path)
    wanted = str(expectation(node, root)) if node else details["msg"]
    if details["type"] == "missing" and not isinstance(details["input"], list):
        return f"expected {wanted}, got nothing"
    if cause is not None:
        return f"{cause}, got {formatted(details['input'])}"
    return f"expected {wanted}, got {formatted(details['input'])}"


def _unknown(name: str, known: list[str]) -> str:
    """Describe an unknown key, with a similar known one or all of them."""
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean {near[0]}?" if near else f"expected {', '.join(known)}"
    return f"unknown key {shortened(name)}: {hint}"
