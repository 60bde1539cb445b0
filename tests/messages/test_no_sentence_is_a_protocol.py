"""No program compares a sentence: what branches does so on a type, a code or a message's id."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    path
    for room in ("station", "plc_interface", "hmi")
    for path in sorted((ROOT / room).rglob("*.py"))
    if ROOT / "station" / "messages" not in path.parents
]
MESSAGE_NAMES = {
    "cause",
    "detail",
    "error",
    "explanation",
    "fault",
    "message",
    "reason",
    "remedy",
    "sentence",
    "trouble",
    "why",
}
"""Names of the station's messages."""
TEXT_METHODS = {
    "endswith", "find", "index", "partition", "removeprefix", "removesuffix", "rpartition", "split", "startswith",
}  # fmt: skip


def is_sentence(node):
    """Return whether an expression is a sentence of ours: a name in `MESSAGE_NAMES`, or a call on one."""
    if isinstance(node, ast.Call):
        if isinstance(node.func, ast.Name) and node.func.id == "str" and node.args:
            return is_sentence(node.args[0])
        return isinstance(node.func, ast.Attribute) and is_sentence(node.func.value)
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return name in MESSAGE_NAMES


def words(node):
    """Return whether an expression is a literal of several words."""
    return isinstance(node, ast.Constant) and isinstance(node.value, str) and len(node.value.split()) > 1


def compared(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            pattern = (
                isinstance(node.func.value, ast.Name)
                and node.func.value.id == "re"
                and any(map(is_sentence, node.args))
            )
            of_bytes = any(isinstance(each, ast.Constant) and isinstance(each.value, bytes) for each in node.args)
            if pattern or (node.func.attr in TEXT_METHODS and is_sentence(node.func.value) and not of_bytes):
                yield ast.unparse(node)
        if isinstance(node, ast.Compare):
            sides = [node.left, *node.comparators]
            if any(map(words, sides)) and any(map(is_sentence, sides)):
                yield ast.unparse(node)


def test_no_sentence_is_compared():
    found = {str(path.relative_to(ROOT)): list(compared(ast.parse(path.read_text("utf-8")))) for path in SOURCES}
    assert found
    assert {path: places for path, places in found.items() if places} == {}
