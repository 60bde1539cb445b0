"""What tells a seed's outline from a body's, and few drupelets from one body."""

import numpy as np
import pytest

from station.settings.segmentation import RobustParameters
from station.twin.digit.press import render_press
from station.vision.drift import without_bands, without_streaks
from station.vision.edge import Edge
from station.vision.edge_signal import envelope
from station.vision.elements import level, show_apart, union
from station.vision.robust import RobustMethod
from station.vision.skirt import unexplained

SHAPE = (320, 240)
ANGLES = np.arange(64) * (2 * np.pi / 64)


def circle(radius, x=120.0, y=160.0):
    points = np.stack([x + radius * np.cos(ANGLES), y + radius * np.sin(ANGLES)], axis=1)
    seen = (points >= 0).all(axis=1) & (points[:, 0] <= SHAPE[1] - 1)
    return Edge(points, seen, np.ones(64)), disc(radius, x, y)


def disc(radius, x=120.0, y=160.0):
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.where(np.hypot(columns - x, rows - y) <= radius, 255, 0).astype(np.uint8)


def hertz(radius, levels, x=120.0, y=160.0):
    """The slope's size around a smooth contact: Johnson's dent outside it, differentiated by steps."""
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    ratio = np.hypot(columns - x, rows - y) / radius

    def dent(q):
        return ((2 - q**2) * np.arcsin(1 / q) + np.sqrt(q**2 - 1)) / np.pi

    outside = np.maximum(ratio, 1.001)
    slope = (dent(outside) - dent(outside + 1e-4)) / 1e-4
    return (levels * np.where(ratio < 1, ratio, slope)).astype(np.float32)


def test_a_smooth_contact_is_surrounded_by_its_own_skirt():
    edge, inside = circle(20)
    assert unexplained(hertz(20, 30), disc(75), edge, inside, 0.0) == pytest.approx(1.15, abs=0.15)


def test_a_seed_in_a_body_is_surrounded_by_more():
    edge, inside = circle(12)
    seed_in_body = np.hypot(hertz(12, 20), hertz(60, 12, x=140.0))
    assert unexplained(seed_in_body, disc(75), edge, inside, 0.0) > 3


def test_surroundings_are_not_judged_at_the_border_nor_without_room():
    edge, inside = circle(20, x=5.0)
    assert unexplained(hertz(20, 30, x=5.0) + 10, disc(75, x=5.0), edge, inside, 0.0) == 0
    edge, inside = circle(20)
    assert unexplained(hertz(20, 30) + 10, disc(30), edge, inside, 0.0) == 0


def test_few_drupelets_are_their_union_and_not_their_hull():
    drupelets = [(90.0, 135.0), (150.0, 135.0), (120.0, 190.0)]
    length = np.max([hertz(16, 30, x, y) * (disc(16, x, y) > 0) for x, y in drupelets], axis=0).astype(np.float32)
    apart = np.max([disc(16, x, y) for x, y in drupelets], axis=0)
    hull = disc(55, 120.0, 152.0)
    found = union(length, hull, level(length, hull, 8.0))
    assert np.count_nonzero(found) == pytest.approx(np.count_nonzero(apart), rel=0.3)
    assert np.count_nonzero(found) < 0.4 * np.count_nonzero(hull)
    assert np.count_nonzero(found & apart) > 0.85 * np.count_nonzero(apart)


def test_elements_show_apart_where_they_are_few_or_stand_clear_of_the_noise():
    assert show_apart(disc(55), 8.0, level_over_noise=0.0)
    assert not show_apart(disc(55), 7.0, level_over_noise=5.0)
    assert show_apart(disc(55), 7.0, level_over_noise=12.0)


def test_the_more_elements_there_are_the_less_the_outermost_are_pressed():
    length = np.full(SHAPE, 20.0, np.float32)
    assert level(length, disc(20), 8.0) == pytest.approx(9.0)
    assert level(length, disc(75), 8.0) == pytest.approx(3.0)


def test_the_envelope_of_a_place_of_one_pixel_is_capped_at_its_level():
    inside = np.zeros(SHAPE, np.uint8)
    inside[101, 101] = 1
    assert envelope(hertz(20, 30), inside, 0.25, 8.0).max() <= hertz(20, 30)[100:102, 100:102].mean() + 1e-3


def test_a_strong_band_of_light_goes_and_a_contact_in_it_stays():
    generator = np.random.default_rng(3)
    contact = np.stack([hertz(30, 20) * factor for factor in (1.0, -0.5, 0.7)], axis=-1)
    banded = contact + generator.normal(size=(*SHAPE, 3)).astype(np.float32)
    banded[:, 100:116] += 12
    calm = (disc(76) == 0).astype(np.float32)
    clean = without_streaks(banded.copy(), calm)
    assert abs(clean[:60, 100:116].mean()) < 3
    assert abs(without_bands(banded)[:60, 100:116].mean()) < 1


@pytest.mark.parametrize(("kind", "closing_mm", "rel"), [("raspberry", 0.6, 0.3), ("strawberry", 0.6, 0.35)])
def test_a_light_touch_of_textured_fruit_is_neither_a_seed_nor_a_hull(kind, closing_mm, rel):
    ratios = []
    for seed in (900, 901, 902):
        press = render_press(kind, seed, (closing_mm,))
        contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, abs=rel)
