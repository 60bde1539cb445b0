"""Debris on the gel, and an LED that is dead: the gel and the light as they are in a working station."""

import numpy as np
import pytest

from station.settings.segmentation import RobustParameters
from station.studies.cohort import member
from station.twin.digit.press import PressOptions, render_press
from station.twin.digit.sensor import Condition, DigitSensor
from station.vision.debris import Debris
from station.vision.median import median_image
from station.vision.robust import RobustMethod
from station.vision.working import resized
from station.vocabulary import Flag

SHAPE = (320, 240)


def bump(radius, levels, x=120.0, y=160.0):
    """Return the grey levels that a dent of that radius adds: a ring of slope, of one sign on either side."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    away = np.hypot(columns - x, rows - y)
    ring = np.exp(-np.square((away - radius) / 3.0)) * (columns - x) / np.maximum(away, 1)
    return levels * ring[..., None] * np.array([1.0, -0.5, 0.7], np.float32)


def light():
    rows, columns = np.mgrid[0 : 1 : SHAPE[0] * 1j, 0 : 1 : SHAPE[1] * 1j]
    return np.stack([70 + 40 * rows, 90 + 50 * columns, 120 - 50 * columns * rows], axis=-1).astype(np.float32)


def halved(change):
    return resized(change.astype(np.float32), (SHAPE[1] // 2, SHAPE[0] // 2))


def test_a_gel_without_debris_is_left_as_it_is():
    debris = Debris(light())
    change = halved(np.random.default_rng(1).normal(size=(*SHAPE, 3)))
    assert debris.clean.all()
    assert debris.bridged(change) is change


def test_a_particle_that_a_contact_hides_does_not_show_in_the_change():
    particle = bump(10, 45).astype(np.float32)
    debris = Debris(light() + particle)
    seen = halved(3.0 - particle)
    assert (debris.clean == 0).any()
    before = np.abs(seen - 3.0).max()
    assert np.abs(debris.bridged(seen) - 3.0).max() < before / 3


def test_a_particle_that_still_stands_out_is_filled_from_around():
    debris = Debris(light() + bump(10, 45).astype(np.float32))
    seen = np.full((*SHAPE, 3), 3.0, np.float32)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    seen[np.hypot(columns - 120, rows - 160) < 13] = 0
    assert debris.bridged(halved(seen))[80, 60] == pytest.approx(3.0, abs=1.0)


def test_two_particles_side_by_side_are_no_edge_of_a_beam_of_light():
    pair = bump(12, 45, x=104) + bump(12, 45, x=134)
    clean = Debris((light() + pair).astype(np.float32)).clean
    assert clean[80, 52] == clean[80, 67] == 0
    beam = np.where(np.abs(np.indices(SHAPE)[1] - 120) < 2, np.float32(45), np.float32(0))[..., None]
    assert Debris(light() + beam * (np.indices(SHAPE)[0] < 160)[..., None]).clean.all()


def test_a_contact_is_too_steep_for_its_size_only_where_the_gel_has_debris():
    dirty, clean = Debris(light() + bump(10, 45).astype(np.float32)), Debris(light())
    assert dirty.may_be(gate=12.0, area_px=700)
    assert not dirty.may_be(gate=9.0, area_px=700)
    assert not dirty.may_be(gate=12.0, area_px=1600)
    assert not clean.may_be(gate=12.0, area_px=700)


def test_debris_that_has_moved_is_hardly_ever_trusted():
    doubtful: list[bool] = []
    without_debris: list[bool] = []
    for seed in range(50_000, 50_010):
        sensor = DigitSensor(seed, seed % 7)
        before, after = Condition(dirt=4), Condition(dirt=4, dirt_moved=1 + seed)
        references = [sensor.frame(None, k / 30, before) for k in range(5)]
        frame = sensor.frame(None, 1.0, after)
        for found, without in ((doubtful, frozenset()), (without_debris, frozenset({"debris"}))):
            contact = RobustMethod(median_image(references), RobustParameters(), without=without).measure(frame)
            found.append(not contact.found or Flag.LOW_CONFIDENCE in contact.flags)
    assert sum(doubtful) >= 9 > sum(without_debris)


@pytest.mark.parametrize(("kind", "first_seed", "closing_mm"), [("blueberry", 1406, 0.4), ("strawberry", 1407, 0.3)])
def test_a_contact_on_debris_is_measured_without_it(kind, first_seed, closing_mm):
    ratios = []
    for seed in range(first_seed, first_seed + 5):
        press = render_press(kind, seed, (closing_mm,), PressOptions(condition=Condition(dirt=3)))
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, rel=0.25)


def test_with_a_dead_led_a_contact_over_most_of_the_field_is_not_taken_for_drift():
    ratios = []
    for seed in range(5):
        press = render_press("rubber_ball", seed, (7.0,), PressOptions(condition=Condition(dead_led="red")))
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, rel=0.1)


def test_a_blueberry_over_most_of_the_field_is_not_taken_for_drift():
    ratios = []
    for number in range(91, 96):
        press = member("blueberry", 2025, number).press()
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[16])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[16]))
    assert np.median(ratios) == pytest.approx(1, rel=0.1)
