"""Confidence: contrast, noise, how much of the edge is seen, and frames that agree."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.vision.confidence import agreement, background_spread, edge_confidence
from station.vision.constants import CONSTANTS
from station.vision.contour import RAYS, Edge


def edge(drop_levels=40.0, seen=1.0):
    drops = np.full(RAYS, float(drop_levels))
    return Edge(np.zeros((RAYS, 2)), np.arange(RAYS) < seen * RAYS, drops)


@given(drop=st.floats(0, 200), noise=st.floats(0.1, 20))
def test_it_is_a_share_that_rises_with_contrast_and_falls_with_noise(drop, noise):
    found = edge_confidence(edge(drop), noise, CONSTANTS)
    assert 0 <= found <= 1
    assert edge_confidence(edge(1.3 * drop), noise, CONSTANTS) >= found
    assert edge_confidence(edge(drop), 1.3 * noise, CONSTANTS) <= found


def test_it_is_one_half_at_the_reliable_ratio():
    assert edge_confidence(edge(2 * CONSTANTS.reliable_ratio), 2.0, CONSTANTS) == pytest.approx(0.5)


def test_it_falls_with_the_share_of_the_edge_that_falls():
    half = edge()
    half.drop_levels[::2] = 0
    assert edge_confidence(half, 1.0, CONSTANTS) < 0.5 * edge_confidence(edge(), 1.0, CONSTANTS)


def test_an_edge_beyond_the_border_is_never_sure():
    whole, most, none = (edge_confidence(edge(seen=share), 1.0, CONSTANTS) for share in (1, 0.5, 0))
    assert most == pytest.approx(whole)
    assert none == 0


def test_the_spread_of_the_background_is_a_standard_deviation():
    signal = np.random.default_rng(0).normal(5, 2, (320, 240)).astype(np.float32)
    background = np.ones((320, 240), np.float32)
    signal[:160], background[:160] = 90, 0
    assert background_spread(signal, background) == pytest.approx(2, rel=0.15)


@given(areas=st.lists(st.floats(0, 1e5), min_size=1, max_size=6))
def test_frames_agree_between_not_at_all_and_wholly(areas):
    assert 0 <= agreement(areas) <= 1


def test_frames_agree_the_less_the_more_they_spread():
    assert agreement([100.0]) == agreement([0.0, 0.0]) == 1
    assert agreement([90.0, 100.0, 110.0]) == pytest.approx(0.5)
    assert agreement([0.0, 0.0, 100.0]) == 0
    with pytest.raises(ValueError, match="at least one"):
        agreement([])
