"""The Add-On Instruction: Rockwell's structure of the file, its language, and the block's behaviour by it."""

import re
from xml.etree import ElementTree as ET

import pytest

from plc_interface.registers.codec import WordOrder, decode
from plc_interface.registers.generate.add_on_instruction import NAME, add_on_instruction
from plc_interface.registers.map import BY_NAME, CONTROL
from tests.plc_interface.registers.generate.dialects.logix_block import LogixBlock, logic

DOCUMENT = add_on_instruction()
ROOT = ET.fromstring(DOCUMENT.encode())
ATOMIC = {"BOOL", "SINT", "INT", "DINT"}


def test_the_file_has_the_structure_of_an_add_on_instructions_export():
    assert (ROOT.tag, ROOT.attrib["TargetType"], ROOT.attrib["TargetName"]) == (
        "RSLogix5000Content", "AddOnInstructionDefinition", NAME,
    )  # fmt: skip
    definition = ROOT.find("Controller[@Use='Context']/AddOnInstructionDefinitions/AddOnInstructionDefinition")
    assert definition is not None
    assert (definition.attrib["Use"], definition.attrib["Name"]) == ("Target", NAME)
    assert [child.tag for child in definition] == ["Description", "Parameters", "LocalTags", "Routines"]
    types = {each.attrib["Name"] for each in ROOT.iter("DataType")} | ATOMIC | {"FBD_TIMER"}
    names = []
    for number, parameter in enumerate(ROOT.iter("Parameter")):
        of = parameter.attrib
        names.append(of["Name"])
        assert of["DataType"] in types
        if number < 2:
            assert (of["Name"], of["Usage"]) == (("EnableIn", "Input"), ("EnableOut", "Output"))[number]
            continue
        by_reference = "Dimensions" in of or of["DataType"] not in ATOMIC
        assert (of["Usage"] == "InOut") == by_reference, "only atomic values are passed by value"
        assert (of["Required"] == "true") == ("ExternalAccess" not in of) == by_reference
    for tag in ROOT.iter("LocalTag"):
        names.append(tag.attrib["Name"])
        assert tag.attrib["DataType"] in types
    assert len({name.lower() for name in names}) == len(names)
    assert [(each.attrib["Name"], each.attrib["Type"]) for each in ROOT.iter("Routine")] == [
        ("Logic", "ST"), ("Prescan", "ST"),
    ]  # fmt: skip
    runs = [definition.attrib[f"Execute{name}"] for name in ("Prescan", "Postscan", "EnableInFalse")]
    assert runs == ["true", "false", "false"], "of each there is a routine, or none"
    for routine in ROOT.iter("Routine"):
        numbers = [int(line.attrib["Number"]) for line in routine.iter("Line")]
        assert numbers == list(range(len(numbers)))


def test_names_are_logixs():
    named = {each.attrib["Name"] for each in ROOT.iter() if "Name" in each.attrib}
    for name in named:
        assert re.fullmatch(r"[A-Za-z_]\w{0,39}", name), name
        assert "__" not in name
        assert not name.endswith("_")


def test_flags_are_bits_of_a_hidden_byte_before_them():
    for data_type in ROOT.iter("DataType"):
        hosts: dict[str, int] = {}
        for member in data_type.iter("Member"):
            of = member.attrib
            if of["Hidden"] == "true":
                assert of["DataType"] == "SINT"
                hosts[of["Name"]] = 0
            elif of["DataType"] == "BIT":
                assert int(of["BitNumber"]) == hosts[of["Target"]] < 8
                hosts[of["Target"]] += 1
            else:
                assert of["DataType"] == "DINT"
        assert hosts


def test_the_logic_is_the_languages_to_the_semicolon(logix):
    text = logic(DOCUMENT)
    logix(text)
    without_comments = re.sub(r"\(\*.*?\*\)", lambda comment: " " * len(comment[0]), text)
    for found in list(re.finditer(";", without_comments))[::7]:
        with pytest.raises(Exception, match=r"Unexpected|No terminal"):
            logix(text[: found.start()] + text[found.end() :])


@pytest.fixture
def plc(make_plc, logix_parser):
    """The block of the other tests, by this instruction."""
    plc = make_plc(WordOrder.LOW_FIRST)
    plc.block = LogixBlock(DOCUMENT, logix_parser, lambda: plc.library.now_s)
    del plc.inputs["low_word_first"]
    return plc


def result_of(plc, *, flags=("pass", "area_valid"), outcome="PASS", **values):
    plc.accepted()
    plc.station.show(0x8001FFFE, 7, outcome, result_flags=BY_NAME["result_flags"].flags(flags), **values)
    plc.scan()
    return plc.block["result"]


def test_a_good_fruit(plc):
    result = result_of(plc, result_closing_mm_x100=-5, result_area_px=70_000, result_encoder=0xFEDCBA98)
    assert (plc.block["done"], plc.block["passed"], plc.block["refused"]) == (True, True, False)
    assert (result["trigger_id"], result["closing_mm_x100"], result["area_px"]) == (7, -5, 70_000)
    assert result["encoder"] & 0xFFFFFFFF == 0xFEDCBA98
    assert plc.control() == {"enable", "acknowledge"}
    assert plc.written("acknowledged_sequence") == 0x8001FFFE, "high words over half their range too"
    assert plc.written("encoder") == 0x00ABCDEF
    plc.station.flags("online", "trigger_ready", "acquiring")
    plc.scan()
    assert not plc.block["may_move"]
    plc.station.flags("online", "trigger_ready")
    plc.scan()
    assert plc.block["may_move"]
    plc.scan(inspect=False)
    assert not plc.block["passed"]
    plc.scan()
    assert plc.block["ready"]


@pytest.mark.parametrize(
    ("outcome", "flags"),
    [("FAIL", ["area_valid"]), ("NO_RESULT", []), ("PASS", ["pass"]), ("PASS", ["pass", "area_valid", "late"]),
     ("PASS", ["pass", "area_valid", "simulated"])],
)  # fmt: skip
def test_what_is_not_surely_good_does_not_pass(plc, outcome, flags):
    result_of(plc, flags=flags, outcome=outcome)
    assert (plc.block["done"], plc.block["passed"]) == (True, False)


def test_the_result_of_another_fruit_is_not_used(plc):
    plc.accepted()
    plc.station.show(4, 6)
    plc.scan()
    assert (plc.block["done"], plc.block["discarded"], plc.written("acknowledged_sequence")) == (False, 1, 4)


def test_a_fruit_laid_in_the_place_of_one_taken_away_does_not_pass_on_its_result(plc):
    plc.accepted()
    plc.scan(inspect=False)
    plc.scan(5, inspect=True, fruit_id=8)
    plc.station.show(5, 7)
    plc.scan(5)
    assert (plc.block["done"], plc.block["passed"]) == (True, False)


def test_ids_over_half_their_range(plc):
    plc.accepted(fruit_id=65_535)
    plc.station.show(5, 65_535)
    plc.scan()
    assert plc.block["passed"]


@pytest.mark.parametrize("shown", ["before the stop", "after it"])
def test_a_controller_that_was_in_prog_passes_no_fruit_on_the_result_of_the_one_before(plc, shown):
    plc.accepted()
    if shown == "before the stop":
        plc.station.show(5, 7)
        plc.scan()
        assert plc.block["passed"]
    plc.library.now_s += 600
    plc.station.show(5, 7)
    plc.block.prescan()
    assert not any(plc.block[name] for name in ("alive", "done", "passed", "may_move"))
    for _ in range(20):
        plc.scan(fruit_id=8)
        assert not plc.block["passed"]
    plc.station.flags("online", "trigger_ready")
    plc.scan(5)
    assert plc.block["alive"]
    assert plc.control() == {"enable"}, "a new rising edge is needed"
    plc.accepted(fruit_id=9)


def test_a_dead_heartbeat_and_a_late_result_divert(plc):
    plc.accepted()
    plc.wait(20.05)
    assert (plc.block["timed_out"], plc.block["passed"]) == (True, False)
    plc.station.beating = False
    plc.wait(2.1)
    assert not any(plc.block[name] for name in ("alive", "ready", "busy", "done", "passed", "may_move", "timed_out"))
    assert plc.control() == frozenset()
    words = plc.block["registers"]
    assert decode(BY_NAME["write_key"], [words[BY_NAME["write_key"].address - CONTROL[0].address]]) == 0x5AFE


def test_a_change_of_recipe(plc):
    plc.station.set(command_sequence_echo=65_535)
    plc.scan(3)
    plc.scan(change_recipe=True, recipe_number=40_000)
    assert plc.control() == {"enable", "execute_command"}
    assert [plc.written(name) for name in ("command_code", "command_argument", "command_sequence")] == [1, 40_000, 1]
    plc.station.flags("online", "trigger_ready", "command_done")
    plc.station.set(command_sequence_echo=1)
    plc.scan()
    assert (plc.block["recipe_busy"], plc.block["recipe_done"]) == (False, True)


def test_enable_falls_while_the_station_inhibits_it(plc):
    plc.scan(3)
    assert plc.control() == {"enable"}
    plc.station.set(more_status=BY_NAME["more_status"].flags(["enable_inhibited"]))
    plc.scan(2)
    assert plc.control() == frozenset()
    plc.station.set(more_status=0)
    plc.scan()
    assert plc.control() == {"enable"}


def test_a_lot_goes_over_as_it_is(plc):
    plc.scan(3, lot=[0x4C31, *[0] * 15], latch_lot=True)
    assert plc.written("lot") == "L1"
