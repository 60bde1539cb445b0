"""A strict evaluator of the Structured Text that is generated, over blark's syntax tree, and a station for it to meet.

It knows what the block uses and refuses everything else: no implicit conversion between types, no number out of its
type's range, no name that is not declared in the same spelling.
"""

import copy
import functools
import operator
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import pytest
from blark import transform
from blark.parse import parse_source_code

from plc_interface.registers.codec import WordOrder, decode, encode
from plc_interface.registers.generate.structured_text import data_types, example, function_block
from plc_interface.registers.map import BY_NAME, CONTROL, MORE_STATUS, STATUS

tree: Any = transform
"""Its classes are made by decorators that hide their fields from the type checker."""

RANGES = {
    "UINT": (0, 2**16 - 1),
    "INT": (-(2**15), 2**15 - 1),
    "UDINT": (0, 2**32 - 1),
    "DINT": (-(2**31), 2**31 - 1),
    "WORD": (0, 2**16 - 1),
    "DWORD": (0, 2**32 - 1),
}
BIT_STRINGS = {"BOOL", "WORD", "DWORD"}
LITERAL = "a number without a type"
COMPARISONS = {
    "=": operator.eq, "<>": operator.ne, "<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge,
}  # fmt: skip


class Typed(NamedTuple):
    """An expression: its type and how to get its value from the variables."""

    kind: Any
    value: Callable[[dict[str, Any]], Any]


class ArrayOf(NamedTuple):
    kind: str
    length: int


@functools.cache
def syntax(source: str) -> list[Any]:
    """The declarations in a source; parsed once in a process, for blark takes seconds."""
    parsed = parse_source_code(source)
    assert parsed.exception is None
    return parsed.transform().items


def list_of(statements: Any) -> list[Any]:
    return [] if statements is None else statements.statements


def convert(value: int, kind: str) -> int:
    """As IEC's X_TO_Y between bit strings and integers of the same width: the bits stay; narrower: the low ones."""
    low, high = RANGES[kind]
    value &= high - low
    return value - (high - low + 1) if value > high else value


class Ton:
    """The standard's on-delay timer."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock, self.Q = clock, False
        self._since: float | None = None

    def __call__(self, inputs: dict[str, Any]) -> None:
        if not inputs["IN"]:
            self._since, self.Q = None, False
            return
        if self._since is None:
            self._since = self._clock()
        self.Q = self._clock() - self._since >= inputs["PT"]


class Unit:
    """A function block or program: `unit(**inputs)` is one scan; `unit["name"]` is a variable."""

    def __init__(self, library: "Library", declared: Any) -> None:
        self._library = library
        self.kinds: dict[str, Any] = {}
        self.variables: dict[str, Any] = {}
        self._constants: set[str] = set()
        for block in declared.declarations:
            for item in block.items:
                self._declare(item, constant=str(getattr(block, "attrs", None) or "").endswith("constant"))
        self._statements = self._body(declared.body.statements)

    def __getitem__(self, name: str) -> Any:
        return self.variables[name]

    def __call__(self, inputs: dict[str, Any] | None = None, **named: Any) -> None:
        for name, value in {**(inputs or {}), **named}.items():
            assert name in self.kinds, name
            self.variables[name] = copy.deepcopy(value)
        for statement in self._statements:
            statement(self.variables)

    def _declare(self, item: Any, *, constant: bool) -> None:
        spec = item.init.spec
        assert not isinstance(spec, tree.ArraySpecification), "two anonymous arrays are two types: name it"
        kind = str(spec.type)
        for declared in item.variables:
            name = str(declared.variable.name)
            assert name not in self.kinds, f"{name} is declared twice"
            self.kinds[name] = kind
            self.variables[name] = self._library.initial(kind)
            if item.init.value is not None:
                self.variables[name] = self._fitting(self._expression(item.init.value), kind, name)(self.variables)
            if constant:
                self._constants.add(name)

    def _body(self, statements: Iterable[Any]) -> list[Callable[[dict[str, Any]], None]]:
        return [self._statement(statement) for statement in statements]

    def _statement(self, node: Any) -> Callable[[dict[str, Any]], None]:
        match node:
            case tree.AssignmentStatement():
                (variable,) = node.variables
                kind, store = self._target(variable)
                value = self._fitting(self._expression(node.expression), kind, str(variable))
                return lambda memory: store(memory, copy.deepcopy(value(memory)))
            case tree.IfStatement():
                return self._branches(node)
            case tree.CaseStatement():
                return self._cases(node)
            case tree.ForStatement():
                return self._loop(node)
            case tree.FunctionCallStatement():
                return self._call(node)
        raise AssertionError(f"not in the subset: {node}")

    def _branches(self, node: Any) -> Callable[[dict[str, Any]], None]:
        arms = [(self._condition(node.if_expression), self._body(list_of(node.statements)))]
        arms += [(self._condition(arm.if_expression), self._body(list_of(arm.statements))) for arm in node.else_ifs]
        otherwise = self._body(list_of(node.else_clause.statements)) if node.else_clause else []

        def run(memory: dict[str, Any]) -> None:
            chosen = next((body for condition, body in arms if condition(memory)), otherwise)
            for statement in chosen:
                statement(memory)

        return run

    def _condition(self, node: Any) -> Callable[[dict[str, Any]], bool]:
        typed = self._expression(node)
        assert typed.kind == "BOOL", f"a condition must be BOOL: {node}"
        return typed.value

    def _cases(self, node: Any) -> Callable[[dict[str, Any]], None]:
        selector = self._expression(node.expression)
        assert node.else_clause is None
        bodies: dict[int, Any] = {}
        for case in node.cases:
            for match in case.matches:
                bodies[int(str(match))] = self._body(list_of(case.statements))

        def run(memory: dict[str, Any]) -> None:
            for statement in bodies[selector.value(memory)]:
                statement(memory)

        return run

    def _loop(self, node: Any) -> Callable[[dict[str, Any]], None]:
        assert node.step is None
        name, first, last = str(node.control.name), self._expression(node.from_), self._expression(node.to)
        assert self.kinds[name] == "INT"
        body = self._body(node.statements.statements)

        def run(memory: dict[str, Any]) -> None:
            for number in range(first.value(memory), last.value(memory) + 1):
                memory[name] = number
                for statement in body:
                    statement(memory)

        return run

    def _call(self, node: Any) -> Callable[[dict[str, Any]], None]:
        name = str(node.name.name)
        wanted = {"IN": "BOOL", "PT": "TIME"} if self.kinds[name] == "TON" else self.variables[name].kinds
        given = {
            str(parameter.name.name): self._fitting(
                self._expression(parameter.value), wanted[str(parameter.name.name)], str(parameter)
            )
            for parameter in node.parameters
        }
        return lambda memory: memory[name]({parameter: value(memory) for parameter, value in given.items()})

    def _target(self, node: Any) -> tuple[Any, Callable[[dict[str, Any], Any], None]]:
        if isinstance(node, tree.SimpleVariable):
            name = str(node.name)
            assert name not in self._constants
            return self.kinds[name], lambda memory, value: operator.setitem(memory, name, value)
        holder, last = self._walk(node, node.elements[:-1]), node.elements[-1]
        if isinstance(last, tree.SubscriptList):
            (subscript,) = last.subscripts
            index = self._expression(subscript)
            return self._library.arrays[holder.kind].kind, lambda memory, value: operator.setitem(
                holder.value(memory), index.value(memory), value
            )
        field = str(last.field.name)
        kind = self._library.structures[holder.kind][field]
        return kind, lambda memory, value: operator.setitem(holder.value(memory), field, value)

    def _walk(self, node: Any, elements: Iterable[Any]) -> Typed:
        name = str(node.name.name if isinstance(node, tree.MultiElementVariable) else node.name)
        assert name in self.kinds, f"{name} is not declared"
        typed = Typed(self.kinds[name], operator.itemgetter(name))
        for element in elements:
            typed = self._inside(typed, element)
        return typed

    def _inside(self, holder: Typed, element: Any) -> Typed:
        if isinstance(element, tree.SubscriptList):
            (subscript,) = element.subscripts
            index = self._expression(subscript)
            element_kind = self._library.arrays[holder.kind].kind
            return Typed(element_kind, lambda memory: holder.value(memory)[index.value(memory)])
        field = str(element.field.name)
        if holder.kind == "TON":
            assert field == "Q"
            return Typed("BOOL", lambda memory: holder.value(memory).Q)
        if holder.kind in self._library.structures:
            return Typed(self._library.structures[holder.kind][field], lambda memory: holder.value(memory)[field])
        return Typed(self._library.blocks[holder.kind].kinds[field], lambda memory: holder.value(memory)[field])

    def _expression(self, node: Any) -> Typed:  # noqa: PLR0911 (one for each kind of node)
        match node:
            case tree.ParenthesizedExpression():
                return self._expression(node.expr)
            case tree.Boolean():
                value = str(node.value).upper() == "TRUE"
                return Typed("BOOL", lambda _: value)
            case tree.Duration():
                assert str(node).count("S") == 1
                assert node.seconds is not None
                seconds = float(node.seconds)
                return Typed("TIME", lambda _: seconds)
            case tree.HexInteger() | tree.Integer():
                assert node.type_name is None
                number = int(str(node.value), 16 if isinstance(node, tree.HexInteger) else 10)
                return Typed(LITERAL, lambda _: number)
            case tree.SimpleVariable():
                return self._walk(node, ())
            case tree.MultiElementVariable():
                return self._walk(node, node.elements)
            case tree.FunctionCall():
                return self._function(node)
            case tree.UnaryOperation():
                inner = self._expression(node.expr)
                assert (str(node.op).upper(), inner.kind) == ("NOT", "BOOL"), node
                return Typed("BOOL", lambda memory: not inner.value(memory))
            case tree.BinaryOperation():
                return self._operation(node)
        raise AssertionError(f"not in the subset: {node!r}")

    def _operation(self, node: Any) -> Typed:
        left, right, op = self._expression(node.left), self._expression(node.right), str(node.op).upper()
        kinds = {left.kind, right.kind} - {LITERAL}
        assert len(kinds) == 1, f"types do not match in {node}: {left.kind} {op} {right.kind}"
        (kind,) = kinds
        if op in COMPARISONS:
            compare = COMPARISONS[op]
            return Typed("BOOL", lambda memory: compare(left.value(memory), right.value(memory)))
        if op in {"AND", "OR"}:
            assert kind in BIT_STRINGS, node
            combine = operator.and_ if op == "AND" else operator.or_
            return Typed(kind, lambda memory: combine(left.value(memory), right.value(memory)))
        assert kind not in BIT_STRINGS, node
        add = {"+": operator.add, "-": operator.sub}[op]
        return Typed(kind, lambda memory: self._library.ranged(add(left.value(memory), right.value(memory)), kind))

    def _function(self, node: Any) -> Typed:
        name = str(node.name.name)
        given = [self._expression(parameter.value) for parameter in node.parameters]
        if name in {"SHL", "SHR"}:
            assert given[0].kind == "DWORD", node
            shift = operator.lshift if name == "SHL" else operator.rshift
            return Typed(
                "DWORD", lambda memory: shift(given[0].value(memory), given[1].value(memory)) & RANGES["DWORD"][1]
            )
        source, _, target = name.partition("_TO_")
        assert [argument.kind for argument in given] == [source], f"{name} of {[one.kind for one in given]} in {node}"
        return Typed(target, lambda memory: convert(given[0].value(memory), target))

    def _fitting(self, typed: Typed, kind: Any, where: str) -> Callable[[dict[str, Any]], Any]:
        if typed.kind == LITERAL and kind in RANGES:
            return lambda memory: self._library.ranged(typed.value(memory), kind)
        assert typed.kind == kind, f"{where} is {kind} and gets {typed.kind}"
        return typed.value


class Library:
    """Data types, function blocks and programs of some sources, with the time that their timers see."""

    def __init__(self, *sources: str) -> None:
        self.now_s = 0.0
        self.structures: dict[str, dict[str, str]] = {}
        self.arrays: dict[str, ArrayOf] = {}
        self.declared: dict[str, Any] = {}
        self.blocks: dict[str, Unit] = {}
        for source in sources:
            for item in syntax(source):
                if not isinstance(item, tree.DataTypeDeclaration):
                    self.declared[str(item.name)] = item
                elif isinstance(item.declaration, tree.ArrayTypeDeclaration):
                    spec = item.declaration.init.spec
                    (span,) = spec.subranges
                    assert int(span.start.value) == 0
                    array = ArrayOf(str(spec.type.type_name), int(span.stop.value) + 1)
                    self.arrays[str(item.declaration.name)] = array
                else:
                    structure = item.declaration
                    fields = [
                        (str(declared.variable.name), str(row.init.spec.type))
                        for row in structure.declarations
                        for declared in row.variables
                    ]
                    assert len(dict(fields)) == len(fields), "a member is declared twice"
                    self.structures[str(structure.name)] = dict(fields)

    def unit(self, name: str) -> Unit:
        return self.blocks.setdefault(name, Unit(self, self.declared[name]))

    def initial(self, kind: Any) -> Any:
        if kind in self.arrays:
            return [self.initial(self.arrays[kind].kind)] * self.arrays[kind].length
        if kind == "TON":
            return Ton(lambda: self.now_s)
        if kind in self.structures:
            return {name: self.initial(inner) for name, inner in self.structures[kind].items()}
        if kind in self.declared:
            return self.unit(kind)
        return False if kind == "BOOL" else 0.0 if kind == "TIME" else dict.fromkeys(RANGES, 0)[kind]

    @staticmethod
    def ranged(value: int, kind: str) -> int:
        low, high = RANGES[kind]
        assert low <= value <= high, f"{value} overflows {kind}"
        return value


class Station:
    """A station of registers that does what a test sets: nothing by itself but beat."""

    def __init__(self, order: WordOrder = WordOrder.HIGH_FIRST) -> None:
        self.order = order
        self.words = [0] * (MORE_STATUS[-1].end - STATUS[0].address)
        self.beating = True
        self.set(packml_mode=BY_NAME["packml_mode"].code("production"))
        self.flags("online", "trigger_ready")

    def set(self, **values: float | str | None) -> None:
        for name, value in values.items():
            register = BY_NAME[name]
            at = register.address - STATUS[0].address
            self.words[at : at + register.words] = encode(register, value, self.order)

    def get(self, name: str) -> Any:
        register = BY_NAME[name]
        at = register.address - STATUS[0].address
        return decode(register, self.words[at : at + register.words], self.order)

    def flags(self, *names: str) -> None:
        self.set(status=BY_NAME["status"].flags(names))

    def beat(self) -> None:
        if self.beating:
            self.set(station_heartbeat=(self.get("station_heartbeat") + 1) % 65_536)

    def show(self, sequence: int, trigger_id: int, outcome: str = "PASS", **values: float | None) -> None:
        """Put up a result; `values` changes single registers of it."""
        flags = ["area_valid", "pass"] if outcome == "PASS" else []
        self.set(
            **{
                "result_sequence": sequence,
                "result_sequence_again": sequence,
                "result_sequence_end": sequence,
                "result_trigger_id": trigger_id,
                "result_outcome": BY_NAME["result_outcome"].code(outcome),
                "result_flags": BY_NAME["result_flags"].flags(flags),
                **values,
            }
        )
        self.flags("online", "trigger_ready", "result_valid")


class Plc:
    """The block in a scan loop with a station."""

    SCAN_S, WAITING_SCAN_S = 0.01, 0.1

    def __init__(self, order: WordOrder = WordOrder.HIGH_FIRST) -> None:
        self.library = Library(data_types(), function_block(), example())
        self.block = self.library.unit("FB_FruitStation")
        self.station = Station(order)
        self.inputs: dict[str, Any] = {
            "connected": True,
            "low_word_first": order is WordOrder.LOW_FIRST,
            "enable": True,
            "fruit_id": 7,
            "encoder": 0x00ABCDEF,
            "fruit_length_mm_x10": 483,
            "size_class": 3,
        }

    def scan(self, scans: int = 1, **inputs: Any) -> None:
        self.inputs.update(inputs)
        for _ in range(scans):
            self._scan(self.SCAN_S)

    def wait(self, duration_s: float) -> None:
        """Pass time in which nothing but timers changes: one scan, which starts them, then one in each 0.1 s."""
        until_s = self.library.now_s + duration_s
        self.scan()
        while self.library.now_s < until_s:
            self._scan(min(self.WAITING_SCAN_S, until_s - self.library.now_s))

    def written(self, name: str) -> Any:
        """A register of the control block as the block wants it written."""
        register = BY_NAME[name]
        at = register.address - CONTROL[0].address
        return decode(register, self.block["registers"][at : at + register.words], self.station.order)

    def control(self) -> frozenset[str]:
        return BY_NAME["control"].names(self.written("control"))

    def accepted(self, fruit_id: int = 7) -> None:
        """Bring the block to where its trigger is accepted."""
        self.scan(3, inspect=False, fruit_id=fruit_id)
        assert self.block["ready"]
        self.scan(inspect=True)
        assert self.control() == {"enable", "trigger"}
        assert self.written("trigger_id") == fruit_id
        assert (self.written("fruit_length_mm_x10"), self.written("size_class")) == (483, 3)
        self.station.set(accepted_trigger_id=fruit_id)
        self.station.flags("online", "trigger_acknowledged", "inspecting")
        self.scan()
        assert self.control() == {"enable"}
        assert (self.written("fruit_length_mm_x10"), self.written("size_class")) == (0, 0)
        self.station.flags("online", "inspecting")
        self.scan()

    def _scan(self, duration_s: float) -> None:
        self.library.now_s += duration_s
        self.station.beat()
        self.block(station=self.station.words, **self.inputs)


@pytest.fixture
def plc() -> Plc:
    return Plc()


@pytest.fixture
def make_plc() -> Callable[[WordOrder], Plc]:
    return Plc


@pytest.fixture(scope="module")
def make_plc_for_examples() -> type[Plc]:
    return Plc


@pytest.fixture
def library() -> Library:
    return Library(data_types(), function_block(), example())


@pytest.fixture
def station() -> Station:
    return Station()
