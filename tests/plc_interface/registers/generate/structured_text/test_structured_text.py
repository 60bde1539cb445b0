"""The Structured Text as text: it parses, its names are free, its numbers are the map's."""

import re

import pytest

from plc_interface.registers.generate.structured_text import configuration, data_types, example, function_block
from plc_interface.registers.map import BY_NAME, GROUP_BY_NAME

RESERVED = {
    # IEC 61131-3:2013, keywords (table 4 and annex), those that could be taken for a name
    "action", "array", "at", "by", "case", "class", "configuration", "constant", "continue", "do", "else", "exit",
    "extends", "final", "finally", "for", "from", "function", "if", "implements", "initial_step", "interface",
    "internal", "interval", "method", "mod", "namespace", "non_retain", "not", "null", "of", "on", "or", "overlap",
    "override", "priority", "private", "program", "protected", "public", "read_only", "read_write", "ref", "ref_to",
    "repeat", "resource", "retain", "return", "single", "step", "string", "struct", "super", "task", "then", "this",
    "time", "to", "transition", "type", "until", "using", "var", "while", "with", "word", "xor", "int", "real",
    "date", "byte", "bool", "dint", "uint", "udint", "dword", "true", "false", "and",
    # standard functions
    "abs", "add", "concat", "delete", "div", "find", "insert", "left", "len", "limit", "max", "mid", "min", "move",
    "mux", "replace", "right", "rol", "ror", "sel", "shl", "shr", "sqrt", "trunc", "ton", "tof", "tp", "r_trig",
    "f_trig", "sr", "rs", "ctu", "ctd",
}  # fmt: skip


@pytest.mark.parametrize("name", ["FB_FruitStation", "PRG_FruitStationExample"])
def test_no_name_is_a_word_of_the_language(library, name):
    unit = library.unit(name)
    fields = {field for structure in library.structures.values() for field in structure}
    assert fields
    assert {word.lower() for word in {*unit.kinds, *fields}} & RESERVED == set()


def test_names_differ_also_where_case_does_not_count(library):
    for names in (*library.structures.values(), library.unit("FB_FruitStation").kinds):
        assert len({name.lower() for name in names}) == len(names)


def test_the_block_reads_and_writes_the_maps_blocks(library):
    kinds = library.unit("FB_FruitStation").kinds
    read = [GROUP_BY_NAME[name].words for name in ("status", "result", "more_status")]
    lengths = {name: library.arrays[kinds[name]].length for name in ("station", "registers", "lot")}
    assert lengths == {
        "station": sum(read), "registers": GROUP_BY_NAME["control"].words, "lot": BY_NAME["lot"].words,
    }  # fmt: skip


def test_the_example_runs_one_fruit(library):
    program = library.unit("PRG_FruitStationExample")
    for scan in range(20):
        library.now_s += 0.01
        received = [0] * library.arrays[program.kinds["received"]].length
        received[0] = BY_NAME["status"].flags(["online", "trigger_ready"])
        received[4] = scan
        program(received=received, exchange_ok=True, line_running=True, fruit_in_place=scan > 10, line_encoder=99)
    sent = program["sent"]
    assert BY_NAME["control"].names(sent[0]) == {"enable", "trigger"}
    assert sent[BY_NAME["trigger_id"].address] == 1
    assert (sent[8], sent[9]) == (0, 99)
    assert program["let_pass"] is False


def test_the_example_diverts_a_fruit_laid_in_the_place_of_one_taken_away(library, station):
    program = library.unit("PRG_FruitStationExample")

    def scan(scans=1, **inputs):
        for _ in range(scans):
            library.now_s += 0.01
            station.beat()
            program(received=station.words, exchange_ok=True, line_running=True, **inputs)

    def accepted(trigger_id):
        scan(3, fruit_in_place=False)
        scan(fruit_in_place=True)
        station.set(accepted_trigger_id=trigger_id)
        station.flags("online", "trigger_acknowledged", "inspecting")
        scan(2)

    accepted(1)
    scan(30, fruit_in_place=False)
    scan(5, fruit_in_place=True)
    station.show(41, 1)
    for _ in range(100):
        scan()
        assert not program["let_pass"]
    station.flags("online", "trigger_ready")
    accepted(3)
    station.show(42, 3)
    station.flags("online", "result_valid", "acquiring")
    scan()
    assert (program["let_pass"], program["move_fruit"]) == (True, False)
    station.flags("online", "trigger_ready")
    scan()
    assert (program["let_pass"], program["move_fruit"]) == (True, True)


@pytest.mark.parametrize("text", [data_types(), function_block(), example(), configuration()])
def test_the_text_is_portable(text):
    assert text.isascii()
    assert "//" not in text
    assert not re.search(r"%[XBWDIQM]", text)
    assert max(map(len, text.splitlines())) <= 140
