"""The S7-1500's source: Siemens' language, names that are declared, and the Structured Text's logic word for word."""

import re

import pytest

from plc_interface.registers.generate.scl import s7_1500
from plc_interface.registers.generate.st_source import parts
from plc_interface.registers.generate.structured_text import ARRAYS, function_block
from plc_interface.registers.map import GROUP_BY_NAME

TEXT = s7_1500()
BLOCKS = {name: whole for whole, name in re.findall(r'(FUNCTION_BLOCK "(\w+)".*?END_FUNCTION_BLOCK)', TEXT, re.DOTALL)}
SYSTEM_TYPES = {"MB_CLIENT", "TCON_IP_v4", "TON_TIME", "HW_ANY", "CONN_OUC"}


def test_the_source_is_the_languages(scl):
    assert [each.data for each in scl(TEXT).children] == [*["user_type"] * 2, *["function_block"] * 3, "data_block"]


@pytest.mark.parametrize("block", ["FB_FruitStationLink", "FB_FruitStationLane"])
def test_no_semicolon_can_be_left_out(scl, block):
    source = BLOCKS[block]
    without_comments = re.sub(r"//[^\n]*", lambda comment: " " * len(comment[0]), source)
    for found in re.finditer(";", without_comments[without_comments.index("VAR_INPUT") :]):
        place = without_comments.index("VAR_INPUT") + found.start()
        if "{" in source[source.rindex("\n", 0, place) : place] and "}" not in source[:place].rpartition("\n")[2]:
            continue  # between the attributes of an instance
        with pytest.raises(Exception, match=r"Unexpected|No terminal"):
            scl(source[:place] + source[place + 1 :])


@pytest.mark.parametrize("block", BLOCKS)
def test_every_local_is_declared_and_every_type_known(scl, block):
    (tree,) = scl(BLOCKS[block]).children
    declared = {str(field.children[0]) for field in tree.find_data("field")}
    used = set(re.findall(r"#([A-Za-z_]\w*)", re.sub(r"16#\w+|T#\w+", "", BLOCKS[block])))
    assert used <= declared
    quoted = {str(token) for kind in tree.find_data("type") for token in kind.children if str(token).startswith('"')}
    assert quoted <= {f'"{name}"' for name in re.findall(r'(?:TYPE|FUNCTION_BLOCK) "(\w+)"', TEXT)}
    assert "S7_Optimized_Access := 'FALSE'" in BLOCKS[block]


def test_the_logic_is_the_structured_texts():
    body = BLOCKS["FB_FruitStation"].partition("\nBEGIN\n")[2].removesuffix("\nEND_FUNCTION_BLOCK")
    plain = re.sub(r"(?<![\w])#", "", body).replace("(IN := WORD", "(WORD").replace(", N := 16)", ", 16)")
    assert plain.replace("SHR(IN := ", "SHR(") == parts(function_block()).body


def test_the_lane_gives_on_what_may_pass_and_what_may_be_moved():
    lane = BLOCKS["FB_FruitStationLane"]
    assert "#let_pass := #fruit_station.done AND #fruit_station.passed;" in lane
    assert "#move_fruit := #fruit_station.may_move;" in lane
    assert "first_scan := #first_scan," in lane


def test_the_client_reads_and_writes_the_maps_blocks_in_turn():
    link = BLOCKS["FB_FruitStationLink"]
    calls = re.findall(r"MB_MODE := (\d+), MB_DATA_ADDR := (\d+), MB_DATA_LEN := (\d+),\s+MB_DATA_PTR := #(\w+)", link)
    assert [(int(mode), int(first), int(count), to) for mode, first, count, to in calls] == [
        (116, 0, ARRAYS["T_FruitStationWrite"], "sent"),
        (103, GROUP_BY_NAME["status"].address, ARRAYS["T_FruitStationRead"], "station"),
    ]


def test_system_types_are_the_tools_own(scl):
    named = {
        str(kind.children[0]).upper()
        for kind in scl(TEXT).find_data("type")
        if not str(kind.children[0]).startswith('"') and len(kind.children) == 1
    }
    plain = {"BOOL", "WORD", "DWORD", "INT", "DINT", "UINT", "UDINT", "TIME"}
    assert named - plain == {name.upper() for name in SYSTEM_TYPES}


def test_the_block_may_be_called_between_two_exchanges(make_plc):
    """The link has fresh words in some cycles only; the block is called in all of them."""
    plc = make_plc()
    plc.accepted()
    plc.station.show(5, 7)
    for _ in range(4):
        plc.scan(connected=False)
        assert (plc.block["busy"], plc.block["done"]) == (True, False)
    plc.scan(connected=True)
    assert plc.block["passed"]
    plc.scan(20, connected=False)
    assert plc.block["passed"]
    assert plc.control() == {"enable", "acknowledge"}
    plc.station.flags("online", "trigger_ready")
    plc.scan(connected=True)
    assert plc.control() == {"enable"}
