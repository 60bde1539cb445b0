"""The Structured Text by a parser of IEC 61131-3 that is not ours, held to each semicolon of the standard."""

import re
from collections.abc import Iterator

import pytest
import tree_sitter_iec61131_3_st as standard
from tree_sitter import Language, Node, Parser

from plc_interface.registers.generate.structured_text import configuration, data_types, example, function_block

CONTROL_STATEMENTS = {"if_statement", "case_statement", "for_statement"}
"""The grammar takes them without the semicolon that the standard's statement list requires, as some vendors do. A
semicolon after one is an empty statement in its tree."""
TEXTS = {"data_types": data_types, "function_block": function_block, "example": example, "configuration": configuration}


def nodes(node: Node) -> Iterator[Node]:
    yield node
    for child in node.children:
        yield from nodes(child)


def accepted(source: str) -> bool:
    """Return whether the text follows the standard, with a semicolon after every statement."""
    root = Parser(Language(standard.language())).parse(source.encode()).root_node
    return not root.has_error and all(
        node.next_sibling is not None and node.next_sibling.type == "empty_statement"
        for node in nodes(root)
        if node.type in CONTROL_STATEMENTS
    )


@pytest.mark.parametrize("text", TEXTS)
def test_the_text_is_the_standards(text):
    assert accepted(TEXTS[text]())


@pytest.mark.parametrize("text", TEXTS)
def test_no_semicolon_can_be_left_out(text):
    source = TEXTS[text]()
    without_comments = re.sub(r"\(\*.*?\*\)", lambda comment: " " * len(comment[0]), source, flags=re.DOTALL)
    places = [found.start() for found in re.finditer(";", without_comments)]
    assert places
    for place in places:
        assert not accepted(source[:place] + source[place + 1 :]), source[max(0, place - 40) : place + 1]
