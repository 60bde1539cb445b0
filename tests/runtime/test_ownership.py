"""Ownership in the runtime: attributes that a part lets others read are written by that part alone."""

import ast
from pathlib import Path

from station.runtime.alarms.manager import AlarmManager
from station.runtime.cycle.registry import InspectionRegistry
from station.runtime.cycle.service import Service
from station.runtime.production.line_state import LineState
from station.runtime.production.plc_commands import PlcCommands

ROOT = Path(__file__).resolve().parents[2]
OWNERS = (AlarmManager, InspectionRegistry, LineState, PlcCommands, Service)


def written(tree):
    """The attributes that are assigned to, each with the words for its object and its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield ast.unparse(node.value), node.attr, node.lineno


def test_no_module_writes_an_attribute_of_another_part():
    files = {path: ast.parse(path.read_text("utf-8")) for path in (ROOT / "station" / "runtime").rglob("*.py")}
    own = {owner.__module__.replace(".", "/") + ".py" for owner in OWNERS}
    public = {
        name
        for path, tree in files.items()
        if str(path.relative_to(ROOT)) in own
        for base, name, _ in written(tree)
        if base == "self" and not name.startswith("_")
    }
    assert {"active", "alarms", "fault", "last_report", "stopped_by_person"} <= public
    assert [
        f"{path.relative_to(ROOT)}:{line} {base}.{name}"
        for path, tree in files.items()
        for base, name, line in written(tree)
        if base != "self" and name in public
    ] == []
