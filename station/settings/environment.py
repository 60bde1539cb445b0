"""The environment variables `STATION_…`, one for every field of the configuration that holds a value."""

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from station.messages import settings as messages
from station.messages.message import Message
from station.settings.problems import Path, Problem, SettingsError, dotted, shortened
from station.settings.schema import Leaf, Node, branches, expectation, found, leaves
from station.settings.yaml_loader import parse_document

PREFIX = "STATION_"
CONFIG_VARIABLE = "STATION_CONFIG"
"""Names the configuration file; no field of it."""
PLACE = messages.ENVIRONMENT()
"""The place of their problems."""


def variable(path: Path) -> str:
    """Return a field's variable: its path's names in capitals, joined by `_`, as `STATION_MODBUS_PORT`."""
    return PREFIX + "_".join(str(part) for part in path).upper()


def named(path: Path, given: Iterable[Path]) -> str | None:
    """Return the variable, with the path inside its value, of a given field or a place inside one; else None."""
    for field in given:
        if path[: len(field)] == field:
            inside = path[len(field) :]
            return (
                variable(field)
                + ("." if inside and isinstance(inside[0], str) else "")
                + (dotted(inside) if inside else "")
            )
    return None


def variables(root: Node) -> dict[str, Leaf]:
    """Return every variable with the field of the configuration's schema that it sets.

    Raises:
        ValueError: two fields would have one variable; one of them needs another name.
    """
    known: dict[str, Leaf] = {}
    for leaf in leaves(root):
        name = variable(leaf.path)
        if name in known or name == CONFIG_VARIABLE:
            raise ValueError(f"{name} would set more than one thing: rename the field {leaf.path}")
        known[name] = leaf
    return known


def overrides(root: Node, environ: Mapping[str, str]) -> tuple[dict[Path, Any], list[Problem]]:
    """Return the environment's values by their fields; and its unknown variables with the prefix, and invalid texts."""
    known = variables(root)
    problems: list[Problem] = []
    values: dict[Path, Any] = {}
    for name in sorted(environ):
        if not name.startswith(PREFIX) or name == CONFIG_VARIABLE:
            continue
        if name not in known:
            problems.append(Problem(PLACE, messages.FIELD(path=shortened(name)), _unknown(name, known)))
            continue
        leaf = known[name]
        try:
            values[leaf.path] = _value(environ[name], leaf.node, root)
        except SettingsError:
            expected = messages.EXPECTED(wanted=expectation(leaf.node, root), found=found(environ[name]))
            problems.append(Problem(PLACE, messages.FIELD(path=name), expected))
    return values, problems


def _value(text: str, node: Node, root: Node) -> Any:
    """Parse a variable's text as the field's value: literally for a text, else as YAML."""
    try:
        content = text.encode()
    except UnicodeEncodeError as error:
        raise SettingsError([]) from error
    if any(branch.get("type") == "string" for branch in branches(node, root)):
        return text
    document = parse_document(content, PREFIX)
    if document.problems:
        raise SettingsError(document.problems)
    return document.value


def _unknown(name: str, known: Iterable[str]) -> Message:
    """Describe an unknown variable, with similar known ones."""
    near = difflib.get_close_matches(name.removeprefix(PREFIX), [each.removeprefix(PREFIX) for each in known], n=1)
    return messages.UNKNOWN_VARIABLE_NEAR(near=PREFIX + near[0]) if near else messages.UNKNOWN_VARIABLE()
