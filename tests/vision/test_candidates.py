"""Contact candidates: where one body or several contacts may lie."""

import numpy as np
import pytest

from station.vision.candidates import around, body_candidates, disc, separate_candidates
from station.vision.constants import CONSTANTS
from station.vision.region import movement

SHAPE = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
THRESHOLD = 1.0


def blob(x, y, radius, height):
    return (height * np.exp(-(np.square(COLUMNS - x) + np.square(ROWS - y)) / (2 * radius**2))).astype(np.float32)


@pytest.fixture
def moved(background_of):
    def make(level, curvature, seed=0):
        noise = np.random.default_rng(seed).normal(0, 0.5, (*SHAPE, 3))
        change = (level[..., None] * np.array([1.0, -1.0, 0.5]) + noise).astype(np.float32)
        background = background_of((level < 0.05 * level.max()).astype(np.float32))
        return movement(change, background, np.ones(SHAPE, np.float32), curvature)

    return make


def test_below_the_threshold_there_is_no_candidate(moved):
    weak = blob(60, 80, 10, 0.9 * THRESHOLD)
    assert body_candidates(moved(blob(60, 80, 10, 8.0), weak), THRESHOLD, CONSTANTS).regions == []
    assert separate_candidates(weak, THRESHOLD).regions == []


def test_the_body_that_has_moved_most_in_all_comes_first(moved):
    level = blob(40, 50, 18, 10.0) + blob(95, 130, 5, 14.0)
    curvature = blob(40, 50, 18, 2.0) + blob(95, 130, 5, 6.0)
    first, second = body_candidates(moved(level, curvature), THRESHOLD, CONSTANTS).regions
    assert first[50, 40]
    assert not first[130, 95]
    assert second[130, 95]


def test_achenes_beside_each_other_are_one_candidate(moved):
    level = sum(blob(40 + 14 * i, 60 + 14 * j, 4, 10.0) for i in range(3) for j in range(3))
    found = body_candidates(moved(level, level / 2), THRESHOLD, CONSTANTS).regions
    assert len(found) == 1
    assert found[0][60:89:14, 40:69:14].all()


def test_a_strong_neighbour_does_not_hide_a_contact_of_its_own():
    found = separate_candidates(blob(30, 40, 10, 20.0) + blob(90, 120, 10, 3.0), THRESHOLD).regions
    assert [bool(region[40, 30]) for region in found] == [True, False]
    assert [bool(region[120, 90]) for region in found] == [False, True]


def test_contacts_that_touch_are_parted_at_their_neck():
    found = separate_candidates(np.maximum(blob(40, 80, 9, 4.0), blob(78, 80, 9, 4.0)), THRESHOLD).regions
    assert len(found) == 2
    assert not (found[0] & found[1]).any()


def test_of_a_faint_body_belongs_what_stands_out_of_the_noise_though_an_achene_outshines_it(moved):
    away = np.hypot(COLUMNS - 60, ROWS - 80)
    ring = np.exp(-np.square((away - 25) / 4)).astype(np.float32)
    level, achene = 2 * ring + blob(85, 80, 4, 12.0), blob(85, 80, 3, THRESHOLD)
    (faint,) = body_candidates(moved(level, 1.5 * achene), THRESHOLD, CONSTANTS).regions
    assert faint[80, 85]
    assert faint[80, 35]
    (firm,) = body_candidates(moved(level, 6 * achene), THRESHOLD, CONSTANTS).regions
    assert firm[80, 85]
    assert not firm[80, 35]


def test_a_weak_contact_starts_from_a_small_disc_around_its_place_and_what_has_moved_with_it(moved):
    curvature = np.zeros(SHAPE, np.float32)
    (alone,) = around((30, 100), moved(blob(90, 30, 10, 4.0), curvature), CONSTANTS).regions
    assert np.argwhere(alone).mean(axis=0) == pytest.approx((100, 30), abs=0.5)
    (joined,) = around((30, 100), moved(blob(40, 100, 10, 4.0) + blob(90, 30, 10, 4.0), curvature), CONSTANTS).regions
    assert (joined >= alone).all()
    assert joined[100, 50]
    assert not joined[30, 90]


def test_a_disc_has_its_radius():
    assert np.count_nonzero(disc(SHAPE, (60, 80), 20)) == pytest.approx(np.pi * 20**2, rel=0.03)
