"""Changed area: where the image has changed, and how far a contour agrees with it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from station.vision.changed_area import area_agreement, changed, growth_agreement
from station.vision.constants import CONSTANTS
from station.vision.region import movement

SHAPE = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
DISC = np.hypot(COLUMNS - 60, ROWS - 80) < 30
AREAS = st.floats(1, 300_000)


@pytest.fixture
def moved(background_of):
    def make(change, flat_field=1.0):
        nothing = np.zeros(SHAPE, np.float32)
        factors = np.full(SHAPE, flat_field, np.float32)
        return movement(change.astype(np.float32), background_of((~DISC).astype(np.float32)), factors, nothing)

    return make


def disc(levels):
    return levels / np.sqrt(3) * DISC[..., None] * np.array([1.0, -1.0, 1.0])


def test_what_differs_by_more_than_a_few_times_the_noise_has_changed(moved):
    found = changed(moved(disc(3 * CONSTANTS.reliable_ratio)), 1.0, CONSTANTS)
    assert set(np.unique(found)) == {0, 1}
    assert np.count_nonzero(found) == pytest.approx(np.count_nonzero(DISC), rel=0.1)
    assert not changed(moved(disc(0.8 * CONSTANTS.reliable_ratio)), 1.0, CONSTANTS).any()


def test_noise_has_not_changed(moved):
    noise = np.random.default_rng(0).normal(0, 3, (*SHAPE, 3))
    assert changed(moved(noise), 3.0, CONSTANTS).mean() < 1e-3
    assert not changed(moved(disc(20.0)), 6.0, CONSTANTS).any()


def test_in_weak_light_a_smaller_change_counts(moved):
    change = disc(0.6 * CONSTANTS.reliable_ratio)
    bright, dark = (np.count_nonzero(changed(moved(change, factor), 1.0, CONSTANTS)) for factor in (1.0, 2.5))
    assert bright == 0
    assert dark > 0.8 * np.count_nonzero(DISC)


@given(contact=AREAS, witnessed=AREAS)
def test_an_agreement_in_size_is_a_share(contact, witnessed):
    assert 0 <= area_agreement(contact, witnessed, CONSTANTS) <= 1


@given(contact=AREAS)
def test_between_a_part_of_the_contact_and_its_halo_any_changed_area_agrees(contact):
    for share in (CONSTANTS.witness_least, 1.0, CONSTANTS.witness_most):
        assert area_agreement(contact, max(1.0, share * contact), CONSTANTS) == pytest.approx(1)


def test_a_contour_that_takes_in_a_small_part_of_what_has_changed_disagrees():
    assert area_agreement(100, 100 * 2 * CONSTANTS.witness_most, CONSTANTS) == pytest.approx(0.25)
    assert area_agreement(0, 1000, CONSTANTS) < 1e-4


def test_a_contour_around_nothing_that_has_changed_disagrees():
    assert area_agreement(10_000, 10_000 * CONSTANTS.witness_least / 2, CONSTANTS) == pytest.approx(0.25)
    assert area_agreement(10_000, 0, CONSTANTS) < 1e-4


@given(then=AREAS, now=AREAS, changed_then=AREAS, changed_now=AREAS)
def test_an_agreement_in_growth_is_a_share(then, now, changed_then, changed_now):
    assert 0 <= growth_agreement((then, now), (changed_then, changed_now)) <= 1


def test_a_contour_that_has_shrunk_alone_disagrees():
    grown, both, alone, much = (
        growth_agreement(contact, witness)
        for contact, witness in (
            ((100, 150), (200, 200)),
            ((100, 80), (200, 160)),
            ((100, 84), (200, 240)),
            ((100, 30), (200, 240)),
        )
    )
    assert grown == pytest.approx(1)
    assert both == pytest.approx(1)
    assert alone == pytest.approx(0.5, abs=0.02)
    assert much < 0.02
