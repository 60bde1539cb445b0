"""The result block as a client takes it."""

import pytest

from plc_interface.client.inspection_result import published_result
from plc_interface.registers.map import BY_NAME, RESULT, STATUS


def result(outcome, flags):
    """Return the result of a block that shows sequence 5."""
    block = {register.name: 0 for register in (*STATUS, *RESULT)}
    block |= dict.fromkeys(("result_sequence", "result_sequence_again", "result_sequence_end"), 5)
    block["status"] = BY_NAME["status"].flags(["result_valid"])
    block["result_outcome"] = BY_NAME["result_outcome"].code(outcome)
    block["result_flags"] = BY_NAME["result_flags"].flags(flags)
    published = published_result(block)
    assert published is not None
    return published


@pytest.mark.parametrize(
    ("outcome", "flags", "passed"),
    [
        ("PASS", ["pass", "area_valid"], True),
        ("PASS", ["pass", "area_valid", "partial", "simulated"], True),
        ("PASS", ["pass"], False),
        ("PASS", ["area_valid"], False),
        ("PASS", ["pass", "area_valid", "late"], False),
        ("FAIL", ["pass", "area_valid"], False),
        ("NO_RESULT", ["pass", "area_valid"], False),
    ],
)
def test_only_what_is_surely_good_passes(outcome, flags, passed):
    assert result(outcome, flags).passed == passed
