"""Rays about a region, the closed path of least cost on them, and the edge that it finds."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.vision.constants import CONSTANTS
from station.vision.contour import RAYS, Rays, closed_path, find_edge
from station.vision.region import radius_of

FEW_RAYS, STEPS = 12, 9
SHAPE = (320, 240)
ROWS, COLUMNS = np.mgrid[: SHAPE[0], : SHAPE[1]]


def followed_from_one_end(cost, stiffness):
    """The same path, one ray after the other and each jump tried."""
    turns = np.concatenate([cost, cost[: FEW_RAYS // 2]])
    best, ways = turns[0], [[step] for step in range(STEPS)]
    for row in turns[1:]:
        before = [
            min(
                (best[start] + stiffness * (start - step) ** 2, start)
                for start in range(max(0, step - 2), min(STEPS, step + 3))
            )
            for step in range(STEPS)
        ]
        ways = [[*ways[start], step] for step, (_, start) in enumerate(before)]
        best = row + np.array([price for price, _ in before])
    start = FEW_RAYS // 4
    return np.roll(ways[int(best.argmin())][start : start + FEW_RAYS], start)


@settings(deadline=None)
@given(seed=st.integers(0, 10_000), stiffness=st.floats(0, 2))
def test_it_is_the_one_that_is_found_by_following_it_from_one_end(seed, stiffness):
    cost = -np.random.default_rng(seed).random((FEW_RAYS, STEPS))
    assert closed_path(cost, stiffness).tolist() == followed_from_one_end(cost, stiffness).tolist()


def test_it_keeps_to_a_cheap_ring_and_bridges_a_gap_in_it():
    cost = np.zeros((64, 64))
    cost[:, 30] = -1
    cost[20:24] = 0
    assert (closed_path(cost, 0.1) == 30).all()


def ellipse(x, y, half_width, half_length, angle_deg=0.0):
    mask = np.zeros(SHAPE, np.uint8)
    return np.asarray(cv2.ellipse(mask, (x, y), (half_width, half_length), angle_deg, 0, 360, 1, -1), np.uint8)


def test_rays_of_a_round_region_are_a_circle():
    rays = Rays.about(ellipse(90, 150, 40, 60))
    assert rays.middle == pytest.approx((90, 150), abs=0.5)
    assert rays.axes @ rays.axes.T == pytest.approx(np.eye(2), abs=1e-6)
    assert radius_of(ellipse(90, 150, 40, 40)) == pytest.approx(40, rel=0.02)


@pytest.mark.parametrize("angle_deg", [0, 40, 90])
def test_rays_of_a_long_region_are_stretched_along_it(angle_deg):
    rays = Rays.about(ellipse(120, 160, 12, 96, angle_deg))
    assert np.linalg.det(rays.axes) == pytest.approx(1)
    lengths, directions = np.linalg.eigh(rays.axes @ rays.axes.T)
    assert lengths[1] / lengths[0] == pytest.approx(8**2, rel=0.15)
    along = np.array([-np.sin(np.deg2rad(angle_deg)), np.cos(np.deg2rad(angle_deg))])
    assert abs(directions[:, 1] @ along) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("region", [ellipse(90, 150, 40, 40), ellipse(120, 160, 12, 96, 30)])
def test_a_closed_line_is_the_same_on_rays_from_its_own_middle(region):
    rays = Rays.about(region)
    radii = radius_of(region) * (1 + 0.1 * np.cos(np.arange(RAYS) * 2 * np.pi / RAYS))
    moved, radii_there = rays.moved_to(rays.points(radii), SHAPE)
    masks = [
        np.asarray(cv2.fillPoly(np.zeros(SHAPE, np.uint8), [np.rint(one.points(r)).astype(np.int32)], 1)) > 0
        for one, r in ((rays, radii), (moved, radii_there))
    ]
    assert np.count_nonzero(masks[0] & masks[1]) > 0.95 * np.count_nonzero(masks[0] | masks[1])


def steep_rim(radius, x=120.0, y=160.0):
    """A change that rises to a contact's rim, and falls in the halo around it."""
    away = np.hypot(COLUMNS - x, ROWS - y) / radius
    return (20 * away / (1 + np.exp((away - 1) / 0.05))).astype(np.float32)


@pytest.mark.parametrize("started_at", [0.8, 1.0, 1.25])
def test_the_edge_is_where_the_change_falls_most_steeply(started_at):
    region = ellipse(120, 160, round(60 * started_at), round(60 * started_at))
    rays = Rays.about(region)
    edge = find_edge(steep_rim(60), region, rays, np.full(RAYS, 60 * started_at), 0.1, CONSTANTS)
    assert edge.seen.all()
    assert np.hypot(*(edge.points - (120, 160)).T) == pytest.approx(np.full(RAYS, 60.0), abs=4)
    assert edge.drop_levels.min() > 5


def test_an_edge_does_not_fall_within_what_was_in_contact_before():
    length = np.maximum(steep_rim(30), 0.3 * steep_rim(70))
    region = ellipse(120, 160, 60, 60)
    edges = [
        find_edge(length, region, Rays.about(region), np.full(RAYS, 60.0), 0.1, CONSTANTS, floor)
        for floor in (None, ellipse(120, 160, 55, 55))
    ]
    free, followed = (np.median(np.hypot(*(edge.points - (120, 160)).T)) for edge in edges)
    assert free < 40
    assert followed == pytest.approx(70, abs=5)
