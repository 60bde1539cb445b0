"""The block's time-out beside the deadline that the station publishes: the PLC waits longer than the station takes."""

import re
from types import SimpleNamespace
from typing import Any

import pytest

from plc_interface.registers.generate.scl import s7_1500
from plc_interface.registers.generate.structured_text import example, function_block
from station.runtime.cycle.pacing import RECORD_NO_RESULT_S, Pacing
from station.settings.configuration import Configuration
from station.settings.recipe import load_recipes

MARGIN_S = 2.0
"""For the PLC's own scans and the exchange."""


@pytest.mark.parametrize("recipe", sorted(load_recipes()))
def test_the_block_waits_longer_than_the_shipped_station_takes(recipe):
    configuration = Configuration()
    cell: Any = SimpleNamespace(
        camera=SimpleNamespace(description=SimpleNamespace(frames_per_s=30.0)),
        gripper=SimpleNamespace(max_width_mm=85.0),
        arm=object(),
    )
    deadline_s = Pacing(configuration, cell).limits(load_recipes()[recipe]).inspection_s
    result_deadline_ms = 1000 * (deadline_s + RECORD_NO_RESULT_S + configuration.handshake.result_margin_s)
    assert result_deadline_ms == 16_300
    for text in (function_block(), example(), s7_1500()):
        times_out_s = re.findall(r"inspection_timeout [:A-Z ]*:= T#(\d+)s", text)
        assert times_out_s
        assert all(1000 * (int(time_out_s) - MARGIN_S) > result_deadline_ms for time_out_s in times_out_s)
