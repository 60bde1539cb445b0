"""Recipe form: every value with title, description, unit and bounds from the model; and parsing of a filled form."""

import re
from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any, NamedTuple

from station.messages.message import Message
from station.settings.recipe_model import Recipe
from station.settings.schema import branches, expectation, find, resolved, schema_of

FIXED = frozenset({"schema_version", "name"})
"""A recipe's identity, which is not edited."""
_LIST = re.compile(r"[;\s]+")

Path = tuple[str | int, ...]


class Field(NamedTuple):
    """One value."""

    path: str
    """As `damage.area[0].area_mm2`."""
    key: str
    """Of its title in the catalogue: the path without places, as `recipe_field.damage.area.area_mm2`."""
    title: str
    description: str
    unit: str
    expected: Message
    """As `a number from 0.1 to 10 mm`."""
    kind: str
    """`number`, `text`, `choice`, `list` or `switch`."""
    choices: tuple[str, ...]
    value: Any
    nullable: bool


class Group(NamedTuple):
    """A group of fields."""

    path: str
    key: str
    title: str
    description: str
    fields: tuple[Field, ...]


class BadFieldError(Exception):
    """A typed text that is no value of its field."""

    def __init__(self, field: Field) -> None:
        super().__init__(field.path)
        self.field = field


def groups(values: Mapping[str, Any]) -> list[Group]:
    """Return a recipe's values, group by group, in the model's order."""
    root = schema_of(Recipe)
    gathered: dict[Path, list[Field]] = {}
    for path, value in _leaves(values, ()):
        if path[0] not in FIXED:
            # The innermost mapping, with the place in a list: each threshold is a group of its own.
            gathered.setdefault(path[:-1], []).append(_field(root, path, value))
    return [Group(dotted(path), _key(path), *_texts(root, path), tuple(fields)) for path, fields in gathered.items()]


def changed(values: Mapping[str, Any], form: Mapping[str, str]) -> dict[str, Any]:
    """Return the differences between a form, texts by the fields' paths, and the recipe; a missing field is unchanged.

    Raises:
        BadFieldError: a text is no value of its field's kind; the station checks the bounds.
    """
    typed = [(field, form[field.path]) for group in groups(values) for field in group.fields if field.path in form]
    return {field.path: value for field, text in typed if (value := parsed(field, text)) != field.value}


def parsed(field: Field, text: str) -> Any:
    """Parse a field's typed text, with a decimal comma or point.

    Raises:
        BadFieldError: it is no value of its kind.
    """
    text = text.strip()
    try:
        match field.kind:
            case "number":
                return None if not text and field.nullable else _number(text)
            case "list":
                return [_number(part) for part in _LIST.split(text) if part]
            case "switch":
                return text == "true"
            case "choice" if text not in field.choices:
                raise BadFieldError(field)
            case _:
                return text
    except ValueError:
        raise BadFieldError(field) from None


def formatted(field: Field, decimal: str) -> str:
    """Format a field's value for typing, with the language's decimal sign."""
    match field.value:
        case None:
            return ""
        case bool():
            return "true" if field.value else "false"
        case list():
            return "; ".join(_figure(each, decimal) for each in field.value)
        case int() | float():
            return _figure(field.value, decimal)
        case _:
            return str(field.value)


def with_changes(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the recipe's values after the changes, unchecked."""

    def walk(value: Any, path: Path) -> Any:
        if dotted(path) in changes:
            return changes[dotted(path)]
        if isinstance(value, dict):
            return {key: walk(inner, (*path, key)) for key, inner in value.items()}
        if isinstance(value, list):
            return [walk(inner, (*path, place)) for place, inner in enumerate(value)]
        return value

    return walk(dict(values), ())


def dotted(path: Path) -> str:
    """Return a path as the recipe editor takes it."""
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path).removeprefix(".")


def field_texts() -> dict[str, tuple[str, str]]:
    """Return the English titles and descriptions of all fields and groups of a recipe, by the catalogue's keys."""
    root = schema_of(Recipe)
    leaves = [path for path in _schema_leaves(root, resolved(root, root), ()) if path[0] not in FIXED]
    return {_key(path): _texts(root, path) for path in (*leaves, *(path[:-1] for path in leaves))}


def _schema_leaves(root: dict[str, Any], node: dict[str, Any], path: Path) -> Iterator[Path]:
    branch = branches(node, root)[0]
    item = resolved(branch.get("items") or {}, root)
    if "properties" in branch:
        for name, child in branch["properties"].items():
            yield from _schema_leaves(root, resolved(child, root), (*path, name))
    elif "properties" in item:
        yield from _schema_leaves(root, item, (*path, 0))
    else:
        yield path


def _leaves(value: Any, path: Path) -> Iterator[tuple[Path, Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, key))
    elif isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        for place, inner in enumerate(value):
            yield from _leaves(inner, (*path, place))
    else:
        yield path, value


def _texts(root: dict[str, Any], path: Path) -> tuple[str, str]:
    """Return the title and the description of a field or group; those of the whole list for one of its items."""
    if not path:
        return "General", ""
    node = find(root, path[:-1] if isinstance(path[-1], int) else path) or {}
    return node.get("title", str(path[-1])), node.get("description", "")


def _key(path: Path) -> str:
    return ".".join(["recipe_field", *([part for part in path if isinstance(part, str)] or ["general"])])


def _field(root: dict[str, Any], path: Path, value: Any) -> Field:
    node = find(root, path) or {}
    title, description = _texts(root, path)
    branch = branches(node, root)[0]
    choices = tuple(map(str, branch.get("enum", ())))
    kind = "choice" if choices else _KINDS.get(branch.get("type", ""), "text")
    return Field(
        path=dotted(path),
        key=_key(path),
        title=title,
        description=description,
        unit=node.get("unit", ""),
        expected=expectation(node, root),
        kind=kind,
        choices=choices,
        value=value,
        nullable=any(resolved(each, root).get("type") == "null" for each in node.get("anyOf", ())),
    )


_KINDS = {"number": "number", "integer": "number", "array": "list", "boolean": "switch"}


def _number(text: str) -> int | float:
    text = text.replace(",", ".").replace("\u202f", "")
    number = float(text)
    if not isfinite(number):
        raise ValueError(text)
    return int(text) if text.lstrip("+-").isdigit() else number


def _figure(value: float, decimal: str) -> str:
    return f"{value:.10g}".replace(".", decimal)
