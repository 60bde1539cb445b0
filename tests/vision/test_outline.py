"""The outline of one contact: a smooth body's edge or textured skin's union, and which of the two."""

from dataclasses import replace

import numpy as np
import pytest

from station.settings.segmentation import RobustParameters
from station.twin.digit.press import render_press
from station.twin.fruit import draw_fruit
from station.vision.constants import CONSTANTS
from station.vision.contour import Rays
from station.vision.outline import find_outline
from station.vision.region import Region
from station.vision.robust import RobustMethod

SHAPE = (320, 240)
HALF = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]


def disc(radius, x=120.0, y=160.0):
    return np.where(np.hypot(COLUMNS - x, ROWS - y) <= radius, 255, 0).astype(np.uint8)


@pytest.fixture
def faint(background_of):
    """The outline of a faint disc with an achene that outshines it, in noise."""

    def make(coherence, levels, floor=None):
        generator = np.random.default_rng(5)
        noise = np.sqrt(np.square(generator.normal(size=(*SHAPE, 3))).sum(axis=2))
        achene = 5 * levels * (disc(12, 110.0, 150.0) > 0)
        length = np.maximum(noise, np.maximum(levels * (disc(36) > 0), achene)).astype(np.float32)
        rows, columns = np.mgrid[: HALF[0], : HALF[1]]
        region = (np.hypot(columns - 60, rows - 80) < 19.5).astype(np.uint8)
        level_levels = np.where(region > 0, np.float32(levels), np.float32(0))
        rays = Rays((60.0, 80.0), np.eye(2))
        body = Region(region, rays, np.full(64, 19.5), level_levels, 0.5, coherence, textured=False)
        background = background_of((disc(56) == 0).astype(np.float32))
        return find_outline(length, body, background, 0.1, CONSTANTS, floor)

    return make


@pytest.mark.parametrize(("coherence", "levels", "taken"), [(0.55, 4.0, True), (0.7, 4.0, False), (0.55, 60.0, False)])
def test_a_faint_body_that_hardly_passes_for_smooth_is_not_outlined_around_its_achene(faint, coherence, levels, taken):
    outline = faint(coherence, levels)
    assert outline.textured is taken
    if taken:
        assert np.count_nonzero(outline.inside) == pytest.approx(np.count_nonzero(disc(36)), rel=0.15)


def test_an_outline_is_drawn_at_the_size_of_the_input(faint):
    for outline in (faint(0.55, 4.0), faint(0.55, 60.0)):
        drawn = outline.drawn(640, 480)
        assert drawn.shape == (640, 480)
        assert set(np.unique(drawn)) == {0, 255}
        assert np.count_nonzero(drawn) == pytest.approx(4 * np.count_nonzero(outline.inside), rel=0.05)


@pytest.mark.parametrize(("kind", "closing_mm", "rel"), [("raspberry", 0.6, 0.3), ("strawberry", 0.6, 0.35)])
def test_a_light_touch_of_textured_fruit_is_neither_an_achene_nor_a_hull(kind, closing_mm, rel):
    ratios = []
    for seed in (900, 901, 902):
        press = render_press(kind, seed, (closing_mm,))
        contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, abs=rel)


@pytest.mark.parametrize("closing_mm", [0.25, 0.45])
def test_a_light_touch_of_a_strawberry_ends_where_its_flesh_does(closing_mm):
    ratios = []
    for seed in (0, 900, 901, 902, 903):
        press = render_press("strawberry", seed, (closing_mm,))
        contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, abs=0.25)


def test_the_faint_rim_of_a_bruised_strawberry_belongs_to_it():
    ratios = []
    for seed in (54, 58, 62, 66, 70):
        press = render_press(replace(draw_fruit("strawberry", seed), bruised=True), seed, (3.3,))
        contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) > 0.8
