"""Description of fields from a model's JSON Schema, for messages, documents and environment variables."""

import json
from collections.abc import Iterator
from functools import cache, reduce
from typing import Any, NamedTuple

from pydantic import BaseModel

from station.messages import expectations as messages
from station.messages import settings
from station.messages.message import Definition, Message
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
    """Return a node of `root` with its reference resolved; keys beside the reference have precedence."""
    while "$ref" in node:
        target = root["$defs"][node["$ref"].rpartition("/")[2]]
        node = {**target, **{key: value for key, value in node.items() if key != "$ref"}}
    return node


def branches(node: Node, root: Node) -> list[Node]:
    """Return the alternatives of a node of `root` without `null`; the node itself if it has none."""
    node = resolved(node, root)
    several = [branch for key in ("anyOf", "oneOf") for branch in node.get(key, ())]
    flat = [each for branch in several for each in branches(branch, root) if each.get("type") != "null"]
    beside = {key: node[key] for key in ("title", "description", "unit") if key in node}
    return [{**branch, **beside} for branch in flat] or [node]


def find(root: Node, path: Path) -> Node | None:
    """Return the node of a field by keys and positions, or None if the schema has no such field."""
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
    """Return the names of the fields inside the mapping at a path."""
    node = find(root, path)
    return [name for branch in branches(node, root) for name in branch.get("properties", ())] if node else []


def leaves(root: Node, node: Node | None = None, path: Path = (), *, into_lists: bool = False) -> Iterator[Leaf]:
    """Return all fields that hold a value, in the model's order.

    Args:
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


def expectation(node: Node, root: Node) -> Message:
    """Describe the accepted values of a field: `a number from 0.1 to 10 mm`."""
    kinds = dict.fromkeys(_alternative(branch, root) for branch in branches(node, root))
    nullable = any(resolved(each, root).get("type") == "null" for each in node.get("anyOf", ()))
    described = reduce(lambda first, second: messages.EITHER(first=first, second=second), kinds)
    return messages.OR_NULL(value=described) if nullable else described


def _alternative(node: Node, root: Node) -> Message:
    """Describe one alternative."""
    if "const" in node or "enum" in node:
        choices = node.get("enum", [node.get("const")])
        known = ", ".join(each if isinstance(each, str) else json.dumps(each) for each in choices)
        return messages.ONE_OF(choices=known) if len(choices) > 1 else messages.EXACTLY(value=known)
    match node.get("type"):
        case "integer" | "number" as kind:
            described = _number(node, _INTEGER if kind == "integer" else _NUMBER)
        case "boolean":
            described = messages.SWITCH()
        case "string":
            described = _text(node)
        case "array":
            described = _list(node, root)
        case _:
            names = ", ".join(node.get("properties", ()))
            described = messages.MAPPING_WITH(names=names) if names else messages.MAPPING()
    return described


class _Numbers(NamedTuple):
    """Messages of a kind of number."""

    any: Definition
    in_unit: Definition
    between: Definition
    conditional: Definition


_INTEGER = _Numbers(messages.INTEGER, messages.INTEGER_IN, messages.INTEGER_BETWEEN, messages.INTEGER_IF)
_NUMBER = _Numbers(messages.NUMBER, messages.NUMBER_IN, messages.NUMBER_BETWEEN, messages.NUMBER_IF)
_CONDITIONS = (
    ("minimum", messages.AT_LEAST),
    ("exclusiveMinimum", messages.ABOVE),
    ("maximum", messages.AT_MOST),
    ("exclusiveMaximum", messages.BELOW),
)


def _number(node: Node, kind: _Numbers) -> Message:
    """Describe a number with its bounds and unit."""
    unit = f" {node['unit']}" if "unit" in node else ""
    low, high = node.get("minimum"), node.get("maximum")
    if low is not None and high is not None:
        return kind.between(least=_whole(low), most=_whole(high), unit=unit)
    conditions = [message(value=_whole(node[name])) for name, message in _CONDITIONS if node.get(name) is not None]
    if conditions:
        condition = reduce(lambda first, second: messages.BOTH(first=first, second=second), conditions)
        return kind.conditional(condition=condition, unit=unit)
    return kind.in_unit(unit=unit) if unit else kind.any()


def _whole(value: float) -> float:
    """Return an integer where the value is one, to be shown without a decimal sign."""
    return int(value) if value == int(value) else value


def _list(node: Node, root: Node) -> Message:
    """Describe a list; its unit is its items'."""
    inner = resolved(node.get("items") or next(iter(node.get("prefixItems", ())), {}), root)
    if "unit" in node:
        inner = {**inner, "unit": node["unit"]}
    length = _length(node.get("minItems"), node.get("maxItems"), _ITEMS)
    described = messages.LIST() if length is None else messages.LIST_OF(length=length)
    if not inner or "properties" in inner:
        return described
    return messages.EACH(list=described, item=expectation(inner, root))


def _text(node: Node) -> Message:
    """Describe a text."""
    text = messages.PATH() if node.get("format") == "path" else messages.TEXT()
    length = _length(node.get("minLength"), node.get("maxLength"), _CHARACTERS)
    if length is not None:
        text = messages.TEXT_OF(text=text, length=length)
    return messages.MATCHING(text=text, pattern=node["pattern"]) if "pattern" in node else text


class _Counted(NamedTuple):
    """Messages of a number of things."""

    exactly: Definition
    least: Definition
    most: Definition
    between: Definition


_ITEMS = _Counted(messages.ITEMS, messages.ITEMS_LEAST, messages.ITEMS_MOST, messages.ITEMS_BETWEEN)
_CHARACTERS = _Counted(
    messages.CHARACTERS, messages.CHARACTERS_LEAST, messages.CHARACTERS_MOST, messages.CHARACTERS_BETWEEN
)


def _length(low: int | None, high: int | None, things: _Counted) -> Message | None:
    """Describe a length; None without a bound."""
    if high is None:
        return None if low is None else things.least(number=low)
    if low == high:
        return things.exactly(number=high)
    return things.between(least=low, most=high) if low else things.most(number=high)


def found(value: Any) -> Message:
    """Describe a value that is not accepted."""
    match value:
        case None:
            return settings.NOTHING()
        case bool():
            return settings.VALUE(value=str(value).lower())
        case str():
            return settings.VALUE(value=f"'{shortened(value, 40)}'")
        case dict():
            return settings.A_MAPPING()
        case list():
            return settings.A_LIST(number=len(value))
        case _:
            return settings.VALUE(value=str(value))
