"""The outline of textured skin, and streaks that must not take a contact with them."""

from dataclasses import replace

import numpy as np
import pytest

from station.settings.segmentation import RobustParameters
from station.twin.digit.press import render_press
from station.twin.fruit import draw_fruit
from station.vision.background import without_bands, without_streaks
from station.vision.outline import find_outline
from station.vision.region import Body
from station.vision.robust import RobustMethod
from station.vision.texture import level, noise_of, union

SHAPE = (320, 240)
HALF = (160, 120)


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


def textured(coherence):
    nothing = np.zeros(HALF, np.uint8)
    return Body(nothing, (60.0, 80.0), np.zeros(64), nothing.astype(np.float32), 1.0, coherence, textured=True)


def test_few_drupelets_are_their_union_and_not_their_hull():
    drupelets = [(90.0, 135.0), (150.0, 135.0), (120.0, 190.0)]
    length = np.max([hertz(16, 30, x, y) * (disc(16, x, y) > 0) for x, y in drupelets], axis=0).astype(np.float32)
    apart = np.max([disc(16, x, y) for x, y in drupelets], axis=0)
    hull = disc(55, 120.0, 152.0)
    found, _ = union(length, hull, level(length, hull, textured(0.5), 0.0), 0.0)
    assert np.count_nonzero(found) == pytest.approx(np.count_nonzero(apart), rel=0.3)
    assert np.count_nonzero(found) < 0.4 * np.count_nonzero(hull)
    assert np.count_nonzero(found & apart) > 0.85 * np.count_nonzero(apart)


def test_a_lone_element_ends_higher_than_the_outermost_of_many():
    length = np.full(SHAPE, 20.0, np.float32)
    few, many = (level(length, disc(radius), textured(0.2), 0.0).max() for radius in (20, 75))
    assert few == pytest.approx(7.8)
    assert many == pytest.approx(3.4)
    assert level(length, disc(75), textured(0.6), 0.0).min() > many


def test_an_area_that_hangs_on_its_level_is_less_sure():
    steep = 20.0 * (disc(40) > 0).astype(np.float32)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    gentle = np.maximum(0, 20 - 0.3 * np.hypot(columns - 120, rows - 160)).astype(np.float32)
    sure, unsure = (union(length, disc(70), np.full(SHAPE, 8, np.float32), 0.0)[1] for length in (steep, gentle))
    assert sure > 0.9
    assert unsure < 0.6


def test_the_fainter_a_body_the_more_its_region_says_where_it_ends():
    region = disc(60)
    faint, clear = (level(np.full(SHAPE, strong, np.float32), region, textured(0.3), 2.0) for strong in (6.0, 200.0))
    middle, edge, beyond = ((160, column) for column in (120, 180, 188))
    assert faint[middle] < 0.2 * faint[edge] < 0.2 * faint[beyond]
    assert clear[middle] == pytest.approx(clear[beyond], rel=0.05)


def test_noise_is_no_element():
    found = level(np.full(SHAPE, 6.0, np.float32), disc(60), textured(0.3), 2.0)
    assert found[160, 168] == pytest.approx(1.7 * 2.0, rel=0.1)


def test_without_background_the_noise_is_not_known():
    length = np.full(SHAPE, 5.0, np.float32)
    assert noise_of(length, np.full(SHAPE, 0.09, np.float32)) == 0
    assert noise_of(length, np.full(SHAPE, 0.11, np.float32)) == 5


@pytest.mark.parametrize(("coherence", "levels", "taken"), [(0.55, 4.0, True), (0.7, 4.0, False), (0.55, 60.0, False)])
def test_a_faint_body_that_hardly_passes_for_smooth_is_not_outlined_around_its_seed(coherence, levels, taken):
    generator = np.random.default_rng(5)
    noise = np.sqrt(np.square(generator.normal(size=(*SHAPE, 3))).sum(axis=2))
    seed = 5 * levels * (disc(12, 110.0, 150.0) > 0)
    length = np.maximum(noise, np.maximum(levels * (disc(36) > 0), seed)).astype(np.float32)
    rows, columns = np.mgrid[: HALF[0], : HALF[1]]
    region = (np.hypot(columns - 60, rows - 80) < 19.5).astype(np.uint8)
    level_levels = np.where(region > 0, np.float32(levels), np.float32(0))
    body = Body(region, (60.0, 80.0), np.full(64, 19.5), level_levels, 0.5, coherence, textured=False)
    outline = find_outline(length, body, (disc(56) == 0).astype(np.float32), 0.1)
    assert outline.textured is taken
    if taken:
        assert np.count_nonzero(outline.inside) == pytest.approx(np.count_nonzero(disc(36)), rel=0.15)


def test_a_strong_band_of_light_goes_and_a_contact_in_it_stays():
    generator = np.random.default_rng(3)
    contact = np.stack([hertz(30, 20) * factor for factor in (1.0, -0.5, 0.7)], axis=-1)
    banded = contact + generator.normal(size=(*SHAPE, 3)).astype(np.float32)
    banded[:, 100:116] += 12
    calm = (disc(76) == 0).astype(np.float32)
    clean = without_streaks(banded.copy(), calm)
    assert abs(clean[:60, 100:116].mean()) < 1
    assert abs(without_bands(banded)[:60, 100:116].mean()) < 1


def test_the_skirt_of_a_contact_that_leaves_little_free_is_no_streak():
    skirt = np.full((*SHAPE, 3), 12.0, np.float32)
    free = np.zeros(SHAPE, np.float32)
    free[: SHAPE[0] // 12] = 1
    few, many = (without_streaks(skirt.copy(), calm)[..., 0].mean() for calm in (free, np.ones(SHAPE, np.float32)))
    assert few > 4
    assert abs(many) < 1


@pytest.mark.parametrize(("kind", "closing_mm", "rel"), [("raspberry", 0.6, 0.3), ("strawberry", 0.6, 0.35)])
def test_a_light_touch_of_textured_fruit_is_neither_a_seed_nor_a_hull(kind, closing_mm, rel):
    ratios = []
    for seed in (900, 901, 902):
        press = render_press(kind, seed, (closing_mm,))
        contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, abs=rel)


@pytest.mark.parametrize(("seed", "closing_mm"), [(0, 0.45), (900, 0.25)])
def test_a_light_touch_of_a_strawberry_ends_where_its_flesh_does(seed, closing_mm):
    press = render_press("strawberry", seed, (closing_mm,))
    contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
    assert contact.area_px == pytest.approx(np.count_nonzero(press.true_masks[0]), rel=0.25)


@pytest.mark.parametrize("seed", [54, 58, 62])
def test_a_bruised_strawberrys_faint_rim_belongs_to_it(seed):
    press = render_press(replace(draw_fruit("strawberry", seed), bruised=True), seed, (3.3,))
    contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
    assert contact.area_px > 0.8 * np.count_nonzero(press.true_masks[0])
