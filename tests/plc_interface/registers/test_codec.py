"""Values to registers and back."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from plc_interface.registers.codec import RegisterValueError, WordOrder, decode, encode, is_invalid, problem
from plc_interface.registers.map import BY_NAME, REFERENCES, REGISTERS
from plc_interface.registers.register import Kind, Register

HIGH, LOW = WordOrder.HIGH_FIRST, WordOrder.LOW_FIRST
TEXT = st.text(st.characters(min_codepoint=0x20, max_codepoint=0x7E), max_size=32)


@pytest.mark.parametrize(
    ("name", "high_first", "low_first"),
    [
        ("reference_u16", (0x1234,), (0x1234,)),
        ("reference_i16", (0xFFFE,), (0xFFFE,)),
        ("reference_u32", (0x1234, 0x5678), (0x5678, 0x1234)),
        ("reference_f32", (0x4145, 0x70A4), (0x70A4, 0x4145)),
        ("reference_u64", (0x0123, 0x4567, 0x89AB, 0xCDEF), (0xCDEF, 0x89AB, 0x4567, 0x0123)),
        ("reference_text", (0x4142, 0x4344), (0x4142, 0x4344)),
    ],
)
def test_references_on_the_wire(name, high_first, low_first):
    register = BY_NAME[name]
    assert encode(register, REFERENCES[name], HIGH) == high_first
    assert encode(register, REFERENCES[name], LOW) == low_first


@pytest.mark.parametrize(
    ("name", "value", "high_first"),
    [
        ("control", 0x8001, (0x8001,)),
        ("alarms", 0x8000_0001, (0x8000, 0x0001)),
        ("result_area_mm2_x100", -2, (0xFFFF, 0xFFFE)),
    ],
)
def test_kinds_without_a_reference_on_the_wire(name, value, high_first):
    assert encode(BY_NAME[name], value, HIGH) == high_first
    assert encode(BY_NAME[name], value, LOW) == high_first[::-1]


def test_the_published_names_of_kinds_and_word_orders():
    assert list(Kind) == ["u16", "i16", "u32", "i32", "u64", "f32", "text", "bits16", "bits32"]
    assert list(WordOrder) == ["high_first", "low_first"]


def values(register: Register) -> st.SearchStrategy:
    match register.kind:
        case Kind.TEXT:
            return TEXT.map(lambda text: text[: 2 * register.words])
        case Kind.F32:
            return st.floats(width=32, allow_nan=False)
        case Kind.I16 | Kind.I32:
            return st.integers(-(2 ** (16 * register.words - 1)), 2 ** (16 * register.words - 1) - 1)
        case _:
            return st.integers(0, 2 ** (16 * register.words) - 1)


@given(st.data(), st.sampled_from(REGISTERS), st.sampled_from(WordOrder))
def test_there_and_back(data, register, order):
    value = data.draw(values(register))
    words = encode(register, value, order)
    assert len(words) == register.words
    assert all(0 <= word <= 0xFFFF for word in words)
    back = decode(register, words, order)
    assert back == (value.rstrip(" ") if isinstance(value, str) else value)


@pytest.mark.parametrize("order", WordOrder)
@pytest.mark.parametrize(
    ("name", "raw"),
    [
        ("result_area_mm2_x100", -(2**31)),
        ("result_area_px", 0xFFFFFFFF),
        ("result_closing_mm_x100", -0x8000),
        ("result_confidence_pct", 0xFFFF),
        ("result_area_mm2", math.nan),
    ],
)
def test_there_is_none_is_a_value_too(name, raw, order):
    register = BY_NAME[name]
    value = decode(register, encode(register, None, order), order)
    assert value == raw or (isinstance(value, float) and math.isnan(value) and math.isnan(raw))
    assert is_invalid(register, value)
    assert not is_invalid(register, 0)
    assert problem(register, value) == ""


def test_what_has_no_invalid_value_takes_none_of_it():
    assert is_invalid(BY_NAME["trigger_id"], 0xFFFF) is False
    with pytest.raises(RegisterValueError, match="trigger_id has no invalid value"):
        encode(BY_NAME["trigger_id"], None)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("trigger_id", 65_536, "u16 and cannot hold 65536"),
        ("trigger_id", -1, "cannot hold -1"),
        ("trigger_id", "7", "cannot hold '7'"),
        ("result_area_mm2", 1e39, "cannot hold 1e"),
        ("encoder", 1.5, "cannot hold 1.5"),
        ("lot", "x" * 33, "32 characters, not the 33"),
        ("lot", "Blåbär", "printable ASCII"),
        ("lot", "a\nb", "printable ASCII"),
        ("lot", 7, "printable ASCII"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(name, value, message):
    with pytest.raises(RegisterValueError, match=message):
        encode(BY_NAME[name], value)


def test_a_wrong_count_of_registers_is_refused():
    with pytest.raises(RegisterValueError, match="encoder lies in 2 registers, not in 1"):
        decode(BY_NAME["encoder"], (1,))


@pytest.mark.parametrize("word", [0x4109, 0x41E9])
def test_a_text_from_the_wire_is_checked(word):
    with pytest.raises(RegisterValueError, match="printable ASCII"):
        decode(BY_NAME["lot"], (word,) * 16)


def test_a_text_ends_at_its_first_nul_and_may_be_filled_up_with_spaces():
    assert decode(BY_NAME["reference_text"], (0x4100, 0x4344)) == "A"
    assert decode(BY_NAME["reference_text"], (0x4120, 0x2020)) == "A"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("command_code", 6, "knows no value 6; there are: 0 none, 1 change_recipe"),
        ("write_key", 1, "knows no value 1"),
        ("control", 1 << 9, "no meaning for the bits 0x0200"),
        ("result_confidence_pct", 101, "from 0 to 100, not 101"),
        ("result_area_mm2_x100", -1, "from 0 to 2.14748e+09, not -1"),
    ],
)
def test_a_value_without_a_meaning_is_told(name, value, message):
    assert message in problem(BY_NAME[name], value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("command_code", 5),
        ("write_key", 0x5AFE),
        ("control", 0x1FF),
        ("lot", ""),
        ("result_confidence_pct", 0),
        ("result_confidence_pct", 100),
    ],
)
def test_a_value_with_a_meaning_stands(name, value):
    assert problem(BY_NAME[name], value) == ""


def test_flags_by_name():
    control = BY_NAME["control"]
    assert control.flags(["enable", "acknowledge"]) == 0b101
    assert control.flags(["acknowledge"]) == 0b100
    assert control.flags([]) == 0
    assert control.names(0b101) == {"enable", "acknowledge"}
    with pytest.raises(KeyError):
        control.flags(["fire"])
    assert BY_NAME["command_code"].code("call_off") == 3
