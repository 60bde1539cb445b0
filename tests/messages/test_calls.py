"""Every message that the source makes gets just its definition's parameters: an error's path is seldom run."""

import ast
from importlib import import_module
from pathlib import Path

from station.messages.message import Definition

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for room in ("station", "plc_interface", "hmi") for path in (ROOT / room).rglob("*.py"))
ROOMS = "station.messages."


def imported(tree: ast.AST) -> dict[str, object]:
    """Return what a module imports from the rooms of messages, by the name that it has there."""
    found: dict[str, object] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and f"{node.module}.".startswith(ROOMS):
            for each in node.names:
                room = import_module(f"{node.module}.{each.name}" if f"{node.module}." == ROOMS else node.module)
                found[each.asname or each.name] = room if f"{node.module}." == ROOMS else getattr(room, each.name)
    return found


def called(function: ast.expr, names: dict[str, object]) -> object:
    if isinstance(function, ast.Name):
        return names.get(function.id)
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return getattr(names.get(function.value.id), function.attr, None)
    return None


def wrong_calls(source: str) -> list[str]:
    tree = ast.parse(source)
    names = imported(tree)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(known := called(node.func, names), Definition):
            given = {each.arg for each in node.keywords}
            if None not in given and (node.args or given != set(known.parameters)):
                found.append(f"line {node.lineno}: {known.id} takes {sorted(known.parameters)}: {ast.unparse(node)}")
    return found


def test_the_parameters_are_the_definitions():
    found = {str(path.relative_to(ROOT)): wrong_calls(path.read_text("utf-8")) for path in SOURCES}
    assert found
    assert {path: calls for path, calls in found.items() if calls} == {}


def test_a_call_with_other_parameters_is_found():
    through_room = "from station.messages import gripper as messages\nmessages.SILENT(place=1)"
    by_name = "from station.messages.gripper import SILENT\nSILENT(place=1, limit=2)"
    assert all("gripper.silent" in wrong_calls(source)[0] for source in (through_room, by_name))
    assert wrong_calls("from station.messages.gripper import SILENT\nSILENT(place=1, limit_s=2)") == []
