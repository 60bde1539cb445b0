"""Fixed numbers: all that the source of the vision declares beside the fitted constants, with its comment on each."""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

VISION = Path(__file__).resolve().parents[2] / "station" / "vision"
_OTHERS = {"paper.py", "pictures.py", "scale.py", "image_quality.py"}
"""The paper's method, pictures for a person, the scale, the gel's health: no part of the robust method."""


class Fixed(NamedTuple):
    """One declaration of one or several numbers."""

    file: str
    names: list[str]
    value: str
    meaning: str
    """Of its docstring; empty where it has none."""


def fixed_numbers() -> Iterator[Fixed]:
    """Every number of the robust method that a module declares, in the files' order."""
    for path in sorted(VISION.glob("*.py")):
        if path.name in _OTHERS:
            continue
        body = ast.parse(path.read_text(encoding="utf-8")).body
        for statement, following in zip(body, [*body[1:], None], strict=True):
            if not isinstance(statement, ast.Assign):
                continue
            names = [name.id for name in ast.walk(statement.targets[0]) if isinstance(name, ast.Name)]
            if all(name.strip("_").isupper() for name in names) and _has_number(statement.value):
                yield Fixed(path.name, names, ast.unparse(statement.value), _docstring(following))


def table() -> list[str]:
    """The numbers as a table."""
    lines = ["| file | numbers | value | meaning and origin |", "|---|---|---|---|"]
    for one in fixed_numbers():
        names = ", ".join(f"`{name}`" for name in one.names)
        lines.append(f"| {one.file} | {names} | {one.value} | {one.meaning} |")
    return lines


def _has_number(value: ast.expr) -> bool:
    return any(type(node.value) in (int, float) for node in ast.walk(value) if isinstance(node, ast.Constant))


def _docstring(statement: ast.stmt | None) -> str:
    if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
        return " ".join(str(statement.value.value).split())
    return ""
