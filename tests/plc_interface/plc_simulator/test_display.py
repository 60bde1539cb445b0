"""The PLC simulator's table: one line a fruit, with a column for its curve only where the caller can draw one."""

from io import StringIO

import pytest
from rich.console import Console

from plc_interface.plc_simulator.display import LineDisplay
from plc_interface.plc_simulator.nest import LaidFruit
from plc_interface.plc_simulator.program import Decision, Passage
from plc_interface.plc_simulator.simulator import Summary

PASSAGE = Passage(3, 7, Decision.FAIL, ("area_over_limit",), 5, 38.04, 3.0, 2.0, 0, None)


def shown(sketch, *, terminal):
    output = StringIO()
    with LineDisplay(Console(file=output, force_terminal=terminal, width=160), Summary(), sketch) as display:
        display.passed(PASSAGE, LaidFruit("strawberry", damaged=True, recipe=1))
    return output.getvalue()


@pytest.mark.parametrize("terminal", [False, True], ids=["lines", "live table"])
def test_a_curve_has_a_column_where_it_can_be_drawn(terminal):
    without, with_curve = (shown(sketch, terminal=terminal) for sketch in (None, "<curve {}>".format))
    assert "area over closing" not in without
    assert "area over closing" in with_curve
    assert "<curve 5>" in with_curve
    for text in (without, with_curve):
        assert all(cell in text for cell in ("strawberry (damaged)", "FAIL", "38.0", "3.00", "area over limit"))


def test_each_value_is_below_its_heading():
    heading, line = shown("<curve {}>".format, terminal=False).splitlines()
    below = {name: line[heading.index(name) :] for name in ("no.", "trigger", "area over closing", "outcome", "reason")}
    assert below["no."].startswith("3 ")
    assert below["trigger"].startswith("7 ")
    assert below["area over closing"].startswith("<curve 5> ")
    assert below["outcome"].startswith("FAIL ")
    assert below["reason"] == "area over limit"
