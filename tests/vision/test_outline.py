"""The outline of one contact: a smooth body's edge or textured skin's union, and which of the two."""

from dataclasses import replace

import numpy as np
import pytest

from station.settings.segmentation import RobustParameters
from station.twin.digit.press import render_press
from station.twin.fruit import draw_fruit
from station.vision.constants import CONSTANTS
from station.vision.contour import Edge, Rays
from station.vision.median import median_image
from station.vision.outline import filled, find_outline
from station.vision.region import Region
from station.vision.robust import RobustMethod

SHAPE = (160, 120)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]
AWAY = np.hypot(COLUMNS - 60, ROWS - 80)


@pytest.fixture
def outlined(background_of):
    """The outline of a disc of 18 px, as a smooth body's or as skin's."""

    def make(*, textured):
        generator = np.random.default_rng(5)
        noise = np.sqrt(np.square(generator.normal(size=(*SHAPE, 3))).sum(axis=2))
        length = np.maximum(noise, 60.0 * (AWAY < 18)).astype(np.float32)
        region = (AWAY < 19.5).astype(np.uint8)
        level = np.where(region > 0, np.float32(60), np.float32(0))
        body = Region(region, Rays((60.0, 80.0), np.eye(2)), np.full(64, 19.5), level, 0.5, 0.55, textured=textured)
        return find_outline(length, body, background_of((AWAY > 28).astype(np.float32)), 0.1, CONSTANTS)

    return make


@pytest.mark.parametrize("textured", [True, False])
def test_an_outline_is_drawn_at_the_size_of_the_input(outlined, textured):
    outline = outlined(textured=textured)
    drawn = outline.drawn(640, 480)
    assert outline.textured is textured
    assert drawn.shape == (640, 480)
    assert set(np.unique(drawn)) == {0, 255}
    assert np.count_nonzero(drawn) == pytest.approx(16 * np.count_nonzero(AWAY < 18), rel=0.05)
    assert np.mean(np.nonzero(drawn), axis=1) == pytest.approx((4 * 80, 4 * 60), abs=4)


def test_outlines_that_are_alike_are_told_apart(outlined):
    one, other = outlined(textured=False), outlined(textured=False)
    assert other != one


@pytest.mark.parametrize("radius_px", [4.0, 20.0, 55.0])
@pytest.mark.parametrize("middle", [(60.0, 80.0), (60.3, 80.5), (3.0, 158.2)])
def test_an_edge_encloses_the_pixels_whose_middle_lies_within(middle, radius_px):
    angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    points = middle + radius_px * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    mask = filled(Edge(points, np.ones(64, bool), np.ones(64)), SHAPE)
    away = np.hypot(COLUMNS - middle[0], ROWS - middle[1])
    chord = np.cos(np.pi / 64)
    assert set(np.unique(mask)) == {0, 255}
    assert np.all(mask[away < chord * radius_px] == 255)
    assert np.all(mask[away > radius_px] == 0)
    assert np.array_equal(filled(Edge(points[::-1], np.ones(64, bool), np.ones(64)), SHAPE), mask)


@pytest.mark.parametrize(("kind", "closing_mm", "rel"), [("raspberry", 0.6, 0.3), ("strawberry", 0.6, 0.35)])
def test_a_light_touch_of_textured_fruit_is_neither_an_achene_nor_a_hull(kind, closing_mm, rel):
    ratios = []
    for seed in (900, 901, 902):
        press = render_press(kind, seed, (closing_mm,))
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, abs=rel)


@pytest.mark.parametrize("closing_mm", [0.25, 0.45])
def test_a_light_touch_of_a_strawberry_ends_where_its_flesh_does(closing_mm):
    ratios = []
    for seed in (0, 900, 901, 902, 903):
        press = render_press("strawberry", seed, (closing_mm,))
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) == pytest.approx(1, abs=0.25)


def test_the_faint_rim_of_a_bruised_strawberry_belongs_to_it():
    ratios = []
    for seed in (54, 58, 62, 66, 70):
        press = render_press(replace(draw_fruit("strawberry", seed), bruised=True), seed, (3.3,))
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
        ratios.append(contact.area_px / np.count_nonzero(press.true_masks[0]))
    assert np.median(ratios) > 0.8
