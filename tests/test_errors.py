"""Stored errors: raised again for as long as their cause lasts."""

import ast
import traceback
from pathlib import Path

import pytest

from station.errors import StationError

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [path for folder in ("station", "plc_interface", "hmi") for path in sorted((ROOT / folder).rglob("*.py"))]


def test_an_error_that_is_raised_again_and_again_does_not_grow():
    error, depths = StationError("away"), set[int]()
    for _ in range(10):
        with pytest.raises(StationError) as caught:
            raise error.again()
        assert caught.value is error
        depths.add(len(list(traceback.walk_tb(error.__traceback__))))
    assert depths == {1}


def is_stored_error(node: ast.expr | None) -> bool:
    """Return whether a raised expression is, or may be, an attribute's error as it is."""
    match node:
        case ast.Attribute(attr=name):
            return name.islower()  # a class of errors begins with a capital
        case ast.BoolOp():
            return any(is_stored_error(value) for value in node.values)
        case _:
            return False


def test_no_kept_error_is_raised_as_it_is():
    raised = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for path in SOURCES
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Raise) and is_stored_error(node.exc)
    ]
    assert raised == [], "`raise error.again()`: else its traceback grows with each time"
