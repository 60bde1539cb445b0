"""Mutation operators: every small change of a module's syntax tree, module-level tables included.

Relational, logical and arithmetic operators as in Offutt et al., "An experimental determination of sufficient mutant
operators" (ACM TOSEM 5, 1996, 99), with left-out statements, arguments and table entries. Annotations, decorators,
docstrings, `__all__` and texts for a person (strings with a space) are no behaviour, and stay.
"""

import ast
import copy
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

_COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),  # codespell:ignore notin
    ast.NotIn: (ast.In,),  # codespell:ignore notin
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitOr,
}
_NO_BEHAVIOUR = {"annotation", "returns", "decorator_list", "type_comment", "type_params"}
_NOT_CHANGED = (ast.Import, ast.ImportFrom, ast.JoinedStr)


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change of one node of a module's tree."""

    module: str
    where: str
    """Function or class; empty for the module itself."""
    line: int
    before: str
    after: str
    occurrence: int
    """Of the same change at the same place, from 1."""
    holder: ast.AST
    field: str
    place: int | None
    """In a list."""
    node: Any
    """Takes the place; None leaves it out."""

    @property
    def name(self) -> str:
        """Stays the same while other lines change."""
        again = f" #{self.occurrence}" if self.occurrence > 1 else ""
        return f"{self.module}:{self.where or '-'}: {self.before} → {self.after}{again}"

    def apply(self) -> None:
        """Change the tree that the mutant was made from."""
        if self.place is None:
            setattr(self.holder, self.field, self.node)
            return
        values = getattr(self.holder, self.field)
        values[self.place : self.place + 1] = [] if self.node is None else [self.node]
        if isinstance(self.holder, ast.Dict) and self.node is None:
            del self.holder.values[self.place]


def mutants(module: str, tree: ast.Module) -> Iterator[Mutant]:
    """Yield every mutant of a module, in the order of its code."""
    seen: Counter[tuple[str, str, str]] = Counter()
    for where, holder, field, place, node, new in _changes(tree, ""):
        before, after = _text(node), _text(new) if new is not None else "(left out)"
        seen[where, before, after] += 1
        line = getattr(node, "lineno", 0)
        yield Mutant(module, where, line, before, after, seen[where, before, after], holder, field, place, new)


def _text(node: ast.AST) -> str:
    """Code in one line; of a condition's branches, only the condition."""
    shown = getattr(node, "test", node)
    text = " ".join(ast.unparse(shown).split())
    return text if len(text) <= 90 else f"{text[:60]} … {text[-25:]}"


_Change = tuple[str, ast.AST, str, int | None, ast.AST, ast.AST | None]


def _changes(holder: ast.AST, where: str) -> Iterator[_Change]:
    for field, value in ast.iter_fields(holder):
        if field in _NO_BEHAVIOUR:
            continue
        nodes = list(enumerate(value)) if isinstance(value, list) else [(None, value)]
        for place, node in nodes:
            if not isinstance(node, ast.AST) or _is_docstring(node) or isinstance(node, _NOT_CHANGED):
                continue
            inner = where
            if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
                inner = f"{where}.{node.name}" if where else node.name
            if (isinstance(node, ast.If) and _is_main(node)) or _is_all(node):
                continue
            for new in _replacements(node):
                yield inner, holder, field, place, node, new
            if place is not None and _may_be_left_out(holder, field, node, len(nodes), in_table=not where):
                stand_in = ast.copy_location(ast.Pass(), node) if isinstance(node, ast.stmt) else None
                yield inner, holder, field, place, node, stand_in
            yield from _changes(node, inner)


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _is_main(node: ast.If) -> bool:
    return "__main__" in ast.unparse(node.test)


def _is_all(node: ast.AST) -> bool:
    return isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"


def _may_be_left_out(holder: ast.AST, field: str, node: ast.AST, count: int, *, in_table: bool) -> bool:
    """Calls and stored values among the statements, named arguments, and in a table every entry and argument."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call)
    if isinstance(node, (ast.Assign, ast.AugAssign)):
        return isinstance(node, ast.AugAssign) or any(not isinstance(each, ast.Name) for each in node.targets)
    if isinstance(node, ast.keyword):
        return True
    if not in_table:
        return False
    return (isinstance(holder, ast.Call) and field == "args") or (
        isinstance(holder, (ast.Tuple, ast.List, ast.Set, ast.Dict)) and field in {"elts", "keys"} and count > 1
    )


def _replacements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that may replace a node."""
    yield from _operators(node)
    yield from _conditions(node)
    match node:
        case ast.Return(value=ast.AST() as value) if not (isinstance(value, ast.Constant) and value.value is None):
            yield _with(node, value=ast.copy_location(ast.Constant(None), node))
        case ast.Break() | ast.Continue():
            yield ast.copy_location(ast.Continue() if isinstance(node, ast.Break) else ast.Break(), node)
        case ast.Constant():
            yield from _constants(node)
        case _:
            pass


def _operators(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Compare():
            for place, op in enumerate(node.ops):
                for other in _COMPARED[type(op)]:
                    yield _with(node, ops=[*node.ops[:place], other(), *node.ops[place + 1 :]])
        case ast.BoolOp():
            yield _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())
        case ast.BinOp() | ast.AugAssign():
            yield _with(node, op=_COMPUTED[type(node.op)]())
        case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert()):
            yield node.operand
        case _:
            pass


def _conditions(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.IfExp() | ast.If() | ast.While() if _is_plain(node.test):
            yield _with(node, test=_not(node.test))
        case ast.comprehension(ifs=[test]) if _is_plain(test):
            yield _with(node, ifs=[_not(test)])
        case _:
            pass


def _constants(node: ast.Constant) -> Iterator[ast.AST]:
    value = node.value
    if isinstance(value, bool):
        yield _with(node, value=not value)
    elif isinstance(value, (int, float)):
        yield _with(node, value=value + 1)
    elif isinstance(value, str) and " " not in value:
        yield _with(node, value=f"{value}XX")


def _is_plain(test: ast.expr) -> bool:
    """No operator in it that is changed anyway."""
    return not isinstance(test, (ast.Compare, ast.BoolOp, ast.UnaryOp))


def _not(test: ast.expr) -> ast.expr:
    return ast.copy_location(ast.UnaryOp(ast.Not(), test), test)


def _with(node: ast.AST, **fields: Any) -> ast.AST:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return ast.fix_missing_locations(new)
