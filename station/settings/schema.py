"""Description of fields from a model's JSON Schema, for messages, documents and environment variables."""

import json
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from pydantic import BaseModel

from station.settings.problems import Path, shortened

Node = dict[str, Any]


class Leaf(NamedTuple):
    """A field that holds a value and no further named fields."""

    path: Path
    node: Node


@cache
def schema_of(model: type[BaseModel]) -> Node:
    """Return a model's JSON Schema."""
    return model.model_json_schema()


def resolved(node: Node, root: Node) -> Node:
    """Return a node with its reference resolved; keys beside the reference have precedence.

    Args:
        node: a part of `root`.
        root: the whole schema.
    """
    while "$ref" in node:
        target = root["$defs"][node["$ref"].rpartition("/")[2]]
        node = {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return node


def branches(node: Node, root: Node) -> list[Node]:
    """Return a node's alternatives without `null`; the node itself if it has none.

    Args:
        node: a part of `root`.
        root: the whole schema.
    """
    node = resolved(node, root)
    several = [branch for key in ("anyOf", "oneOf") for branch in node.get(key, ())]
    flat = [each for branch in several for each in branches(branch, root) if each.get("type") != "null"]
    beside = {key: node[key] for key in ("title", "description", "unit") if key in node}
    return [{**branch, **beside} for branch in flat] or [node]


def find(root: Node, path: Path) -> Node | None:
    """Return the node of a field, or None if the schema has no such field.

    Args:
        root: the whole schema.
        path: keys and positions.
    """
    found = [resolved(root, root)]
    for part in path:
        found = [child for node in found for branch in branches(node, root) for child in _children(branch, part)]
    return resolved(found[0], root) if found else None


def _children(node: Node, part: str | int) -> list[Node]:
    """Return the node of one entry or item, as a list of none or one."""
    if isinstance(part, int):
        items = node.get("prefixItems", ())
        child = items[part] if part < len(items) else node.get("items")
        if isinstance(child, dict) and "unit" in node:
            child = {**child, "unit": node["unit"]}
    else:
        child = node.get("properties", {}).get(part, node.get("additionalProperties"))
    return [child] if isinstance(child, dict) else []


def names(root: Node, path: Path) -> list[str]:
    """Return the names of the fields inside a mapping.

    Args:
        root: the whole schema.
        path: of the mapping.
    """
    node = find(root, path)
    return [name for branch in branches(node, root) for name in branch.get("properties", ())] if node else []


def leaves(root: Node, node: Node | None = None, path: Path = (), *, into_lists: bool = False) -> Iterator[Leaf]:
    """Return all fields that hold a value, in the model's order.

    Args:
        root: the whole schema.
        node: where to begin; the root by default.
        path: the path of `node`.
        into_lists: go on into lists of mappings, whose path then ends in `[]`, and into mappings that may be null.
    """
    node = resolved(root if node is None else node, root)
    if "properties" in node:
        for name, child in node["properties"].items():
            yield from leaves(root, child, (*path, name), into_lists=into_lists)
        return
    yield Leaf(path, node)
    mappings = [branch for branch in branches(node, root) if "properties" in branch and "anyOf" in node]
    if into_lists and len(mappings) == 1:  # one that may be null
        yield from leaves(root, mappings[0], path, into_lists=True)
    item = resolved(node.get("items") or {}, root)
    if into_lists and "properties" in item:
        yield from leaves(root, item, (*path[:-1], f"{path[-1]}[]"), into_lists=True)


def expectation(node: Node, root: Node) -> str:
    """Describe the accepted values of a field: `a number from 0.1 to 10 mm`.

    Args:
        node: the field's node.
        root: the whole schema.
    """
    words = [_alternative(branch, root) for branch in branches(node, root)]
    nullable = any(resolved(each, root).get("type") == "null" for each in node.get("anyOf", ()))
    return " or ".join([*dict.fromkeys(words), *(["null"] if nullable else [])])


def _alternative(node: Node, root: Node) -> str:
    """Describe one alternative."""
    if "const" in node or "enum" in node:
        choices = node.get("enum", [node.get("const")])
        known = ", ".join(each if isinstance(each, str) else json.dumps(each) for each in choices)
        return f"one of {known}" if len(choices) > 1 else known
    match node.get("type"):
        case "integer" | "number" as kind:
            words = ("an integer" if kind == "integer" else "a number") + bounds(node)
        case "boolean":
            words = "true or false"
        case "string":
            words = _text(node)
        case "array":
            words = _list(node, root)
        case _:
            words = f"a mapping with {', '.join(node['properties'])}" if node.get("properties") else "a mapping"
    return words


def _list(node: Node, root: Node) -> str:
    """Describe a list; its unit is its items'."""
    inner = resolved(node.get("items") or next(iter(node.get("prefixItems", ())), {}), root)
    if "unit" in node:
        inner = {**inner, "unit": node["unit"]}
    of = f", each {expectation(inner, root)}" if inner and "properties" not in inner else ""
    return f"a list{_length(node, 'minItems', 'maxItems', 'item')}{of}"


def _text(node: Node) -> str:
    """Describe a text."""
    kind = "a path" if node.get("format") == "path" else "a text"
    pattern = f" that matches {node['pattern']}" if "pattern" in node else ""
    return kind + _length(node, "minLength", "maxLength", "character") + pattern


def _length(node: Node, least: str, most: str, thing: str) -> str:
    """Return ` of 1 to 20 items`, or nothing without a bound."""
    low, high = node.get(least), node.get(most)
    if low is None and high is None:
        return ""
    if low == high:
        return f" of {low} {thing}{'s' if low != 1 else ''}"
    span = f"at least {low}" if high is None else f"at most {high}" if not low else f"{low} to {high}"
    return f" of {span} {thing}s"


def bounds(node: Node) -> str:
    """Return a number's bounds and unit with a space before them: ` from 1 to 10 mm`, ` in mm`.

    Args:
        node: a number's node.
    """
    unit = f" {node['unit']}" if "unit" in node else ""
    low, above = node.get("minimum"), node.get("exclusiveMinimum")
    high, below = node.get("maximum"), node.get("exclusiveMaximum")
    if low is not None and high is not None:
        return f" from {figure(low)} to {figure(high)}{unit}"
    parts = [
        f"{word} {figure(value)}"
        for word, value in (("at least", low), ("above", above), ("at most", high), ("below", below))
        if value is not None
    ]
    return f" {' and '.join(parts)}{unit}" if parts else f" in{unit}" if unit else ""


def figure(value: float) -> str:
    """Format a number to six digits, without a needless `.0`.

    Args:
        value: the number.
    """
    return str(int(value)) if value == int(value) else f"{value:.6g}"


def formatted(value: Any) -> str:
    """Format a value for a message.

    Args:
        value: anything that a document holds.
    """
    match value:
        case None:
            return "nothing"
        case bool():
            return "true" if value else "false"
        case str():
            return f"'{shortened(value, 40)}'"
        case dict():
            return "a mapping"
        case list():
            return f"a list of {len(value)}"
        case _:
            return str(value)
