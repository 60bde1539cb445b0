"""Counts that wrap."""

from hypothesis import given
from hypothesis import strategies as st

from plc_interface.outputs.can.counts import RANGE, ahead, further

COUNTS = st.integers(0, RANGE - 1)


@given(COUNTS, st.integers(-(RANGE // 2), RANGE // 2 - 1))
def test_what_lies_further_on_is_so_far_ahead(count, way):
    there = further(count, way)
    assert 0 <= there < RANGE
    assert ahead(count, there) == way


@given(COUNTS, COUNTS)
def test_the_way_leads_there_and_is_the_shorter_one(here, there):
    way = ahead(here, there)
    assert further(here, way) == there
    assert -(RANGE // 2) <= way < RANGE // 2


def test_the_wrap():
    assert ahead(0xFFFF_FFFE, 3) == 5
    assert ahead(3, 0xFFFF_FFFE) == -5
