"""The Add-On Instruction run as Logix does: 32-bit signed numbers, INT arrays, COP with the low word first."""

import copy
import operator
from collections.abc import Callable, Iterator
from typing import Any
from xml.etree import ElementTree as ET

from lark import Lark, Token

OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "eq": operator.eq, "ne": operator.ne, "lt": operator.lt, "gt": operator.gt,
    "add": operator.add, "sub": operator.sub, "mul": operator.mul, "and_": operator.and_, "or_": operator.or_,
}  # fmt: skip
LIMITS = {"DINT": 2**31, "INT": 2**15}


def logic(document: str, routine: str = "Logic") -> str:
    """A routine's text."""
    lines = ET.fromstring(document.encode()).iterfind(f".//Routine[@Name='{routine}']/STContent/Line")
    return "\n".join(line.text or "" for line in lines)


class LogixBlock:
    """One instance: `block(**inputs)` is one scan, `block["name"]` a parameter or local tag."""

    def __init__(self, document: str, parser: Lark, now_s: Callable[[], float]) -> None:
        root = ET.fromstring(document.encode())
        self._now_s = now_s
        self._statements = self._parsed(parser, logic(document))
        self._prescan = self._parsed(parser, logic(document, "Prescan"))
        self._types = {
            each.attrib["Name"]: {
                member.attrib["Name"]: member.attrib["DataType"] == "BIT"
                for member in each.iter("Member")
                if member.attrib["Hidden"] == "false"
            }
            for each in root.iter("DataType")
        }
        self.kinds: dict[str, str] = {}
        self.variables: dict[str, Any] = {}
        for tag in (*root.iter("Parameter"), *root.iter("LocalTag")):
            name, kind = tag.attrib["Name"], tag.attrib["DataType"]
            assert name not in self.kinds, f"{name} is declared twice"
            self.kinds[name] = kind
            default = tag.find("DefaultData/DataValue")
            self.variables[name] = (
                [0] * int(tag.attrib["Dimensions"])
                if "Dimensions" in tag.attrib
                else self._initial(kind)
                if default is None
                else int(default.attrib["Value"])
            )

    @staticmethod
    def _parsed(parser: Lark, text: str) -> list[Any]:
        tree: Any = parser.parse(text)
        return tree.children[0].children

    def __getitem__(self, name: str) -> Any:
        value = self.variables[name]
        return [word & 0xFFFF for word in value] if isinstance(value, list) else value

    def __call__(self, **inputs: Any) -> None:
        """One scan; words of arrays may be given unsigned, as a Modbus client has them."""
        for name, value in inputs.items():
            assert name in self.kinds, name
            self.variables[name] = [_signed(word, 16) for word in value] if isinstance(value, list) else value
        self._run(self._statements)

    def prescan(self) -> None:
        """Run the routine Prescan, as the controller does between PROG and the first scan."""
        self._run(self._prescan)

    def _initial(self, kind: str) -> Any:
        if kind == "FBD_TIMER":
            return {"TimerEnable": False, "PRE": 0, "DN": False, "since": None}
        if kind in self._types:
            return {name: False if is_bit else 0 for name, is_bit in self._types[kind].items()}
        return {"BOOL": False, "DINT": 0}[kind]

    def _run(self, statements: Iterator[Any] | list[Any]) -> None:
        for statement in statements:
            self._step(statement)

    def _step(self, node: Any) -> None:
        match node.data:
            case "assignment":
                self._store(node.children[0], self._value(node.children[1]))
            case "call":
                self._instruct(node.children[0])
            case "if_":
                *arms, otherwise = node.children
                for condition, body in zip(arms[::2], arms[1::2], strict=True):
                    is_true = self._value(condition)
                    assert isinstance(is_true, bool), "a condition has to be BOOL"
                    if is_true:
                        self._run(body.children)
                        return
                self._run(otherwise.children if otherwise is not None else [])
            case "case_":
                wanted = self._value(node.children[0])
                (body,) = (case.children[1] for case in node.children[1:] if int(case.children[0]) == wanted)
                self._run(body.children)
            case "for_":
                place, first, last, body = node.children
                for number in range(self._value(first), self._value(last) + 1):
                    self._store(place, number)
                    self._run(body.children)
            case other:
                raise AssertionError(other)

    def _instruct(self, node: Any) -> None:
        name, *operands = node.children
        if name == "TONR":
            timer = self._value(operands[0])
            if not timer["TimerEnable"]:
                timer["since"], timer["DN"] = None, False
                return
            timer["since"] = self._now_s() if timer["since"] is None else timer["since"]
            timer["DN"] = 1000 * (self._now_s() - timer["since"]) >= timer["PRE"]
            return
        assert name == "COP", name
        source, (holder, key), length = self._value(operands[0]), self._place(operands[1]), self._value(operands[2])
        if isinstance(source, dict):
            assert length == 1
            assert self.kinds[str(operands[0].children[0])] == self.kinds[key]
            holder[key] = copy.deepcopy(source)
            return
        assert type(source) is int
        for at in range(length):
            holder[key + at] = _signed(source >> 16 * at, 16)

    def _place(self, node: Any) -> tuple[Any, Any]:
        """The holder and the key in it."""
        name, *inner = node.children
        assert str(name) in self.kinds, f"{name} is not declared"
        holder: Any = self.variables
        key: Any = str(name)
        for part in inner:
            holder = holder[key]
            (last,) = part.children
            if part.data == "member":
                key = str(last)
                assert key in holder, f"{name} has no {key}"
            else:
                key = self._value(last)
                assert 0 <= key < len(holder), f"{name} has no {key}"
        return holder, key

    def _store(self, node: Any, value: Any) -> None:
        holder, key = self._place(node)
        before = holder[key]
        assert not isinstance(before, (dict, list)), "structures are copied by COP"
        if isinstance(before, bool):
            assert value in {0, 1}
            holder[key] = bool(value)
            return
        limit = LIMITS["INT" if isinstance(holder, list) else "DINT"]
        assert type(value) is int
        assert -limit <= value < limit, f"{value} overflows"
        holder[key] = value

    def _value(self, node: Any) -> Any:
        if isinstance(node, Token):
            return int(node)
        match node.data:
            case "number":
                return int(node.children[0])
            case "hexadecimal":
                return _signed(int(node.children[0].removeprefix("16#"), 16), 32)
            case "target":
                holder, key = self._place(node)
                return holder[key]
            case "not_":
                operand = self._value(node.children[0])
                assert isinstance(operand, bool)
                return not operand
        left, right = (self._value(child) for child in node.children)
        assert isinstance(left, bool) == isinstance(right, bool), f"{node.data} of BOOL and number"
        done = OPERATIONS[node.data](left, right)
        assert isinstance(done, bool) or -(2**31) <= done < 2**31, f"{done} overflows"
        return done


def _signed(value: int, bits: int) -> int:
    value &= 2**bits - 1
    return value - 2**bits if value >> (bits - 1) else value
