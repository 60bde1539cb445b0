"""The cycle's table and the station agree: each event is posted, each action is carried out by one part."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from station.inspection.cycle import TABLE, Action, Event, Raise

ROOT = Path(__file__).resolve().parents[3] / "station"
RUNTIME = [ast.parse(path.read_text(encoding="utf-8")) for path in (ROOT / "runtime").rglob("*.py")]
DEADLINES = ast.parse((ROOT / "inspection" / "deadlines.py").read_text(encoding="utf-8"))


def named(node: ast.AST | None, enum: type) -> Iterator[str]:
    """The members of an enum that a part of the source names."""
    for each in ast.walk(node) if node is not None else ():
        if isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name) and each.value.id == enum.__name__:
            yield each.attr


def given(tree: ast.AST) -> Iterator[str]:
    """The events that a module posts, returns or maps something to: not those that it only compares with."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Return | ast.AnnAssign | ast.Assign):
            value = node.value
            compared = [each for each in ast.walk(value or node) if isinstance(each, ast.Compare)]
            yield from set(named(value, Event)) - {name for each in compared for name in named(each, Event)}
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "post":
            yield from named(node, Event)


def test_the_table_has_no_event_that_nobody_posts_and_the_station_posts_none_that_it_does_not_have():
    posted = {name for tree in (*RUNTIME, DEADLINES) for name in given(tree)}
    assert {event.name for event in Event} - posted == set()
    assert {event for _, event in TABLE} == set(Event)


def test_each_action_of_the_table_is_carried_out_by_exactly_one_part():
    carriers = Counter(
        name
        for tree in RUNTIME
        for node in ast.walk(tree)
        if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Dict)
        for key in node.value.keys
        for name in named(key, Action)
    )
    carriers["HALT"] += 1  # the runner's own: it forgets what is under way
    assert dict(carriers) == dict.fromkeys(Action.__members__, 1)
    actions = {action for transition in TABLE.values() for action in transition.actions}
    assert actions == set(Action) | {action for action in actions if isinstance(action, Raise)}
