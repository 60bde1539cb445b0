from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from station.twin.contact import FruitOnGel, Pose
from station.twin.fruit import Kind, draw_fruit
from station.twin.gel import MM_PER_PX, Gel, Surface, dent_mm, half_space_surface
from station.twin.squeeze import Squeeze
from station.twin.world import DIGIT_MM, World
from tests.manual_clock import ManualClock

KINDS = st.sampled_from(list(Kind))


@given(KINDS, st.integers(0, 500), st.lists(st.floats(0, 12), min_size=2, max_size=8).map(sorted))
def test_force_approach_and_dent_never_fall_as_the_fingers_close(kind, seed, closings):
    squeeze = Squeeze(draw_fruit(kind, seed), Gel())
    steps = [squeeze.at(closing) for closing in closings]
    for name in ("force_n", "approach_mm", "dent_mm"):
        values = [getattr(step, name) for step in steps]
        assert values == sorted(values)
    for step in steps:
        assert 0 <= step.dent_mm <= step.approach_mm <= step.closing_mm + 1e-6
        assert step.dent_mm < Gel().thickness_mm


@settings(max_examples=12, deadline=None)
@given(KINDS, st.integers(0, 50), st.floats(-15, 15), st.floats(0, 360))
def test_the_true_area_never_shrinks_as_the_fingers_close(kind, seed, tilt, turn):
    fruit, gel = draw_fruit(kind, seed), Gel()
    squeeze, contact = Squeeze(fruit, gel), FruitOnGel(fruit, Pose(200, 300, turn, tilt), gel)
    masks = [contact.pressed(squeeze.at(closing)).true_mask for closing in np.linspace(0, 0.3 * fruit.width_mm, 8)]
    assert not masks[0].any()
    for smaller, larger in pairwise(masks):
        assert not (smaller & ~larger).any()


@pytest.mark.parametrize("closing_mm", [0.1, 0.2, 0.4])
def test_a_hard_spheres_contact_is_hertzs(closing_mm):
    sphere, gel = draw_fruit(Kind.TEST_SPHERE, 0), Gel()
    step = Squeeze(sphere, gel).at(closing_mm)
    # The sphere is rigid beside gel and sponge: the gel takes the approach, and a² = R·δ.
    radius_mm = np.sqrt(3.0 * step.approach_mm)
    hertz_n = 4 / 3 * gel.modulus_mpa / (1 - gel.poisson**2) * np.sqrt(3.0) * step.approach_mm**1.5
    assert step.dent_mm == pytest.approx(step.approach_mm, rel=0.01)
    assert step.force_n == pytest.approx(hertz_n * gel.stiffening(step.approach_mm, 3.0), rel=0.01)
    footprint = FruitOnGel(sphere, Pose(), gel).pressed(step)
    # The visible edge is 3.5 px (0.093 mm) outside Hertz's, and up to 0.1 mm more where the dent is steep.
    assert radius_mm + 0.08 < np.sqrt(footprint.true_area_mm2 / np.pi) < radius_mm + 0.25


@given(st.floats(0.05, 1.5))
def test_the_dent_goes_over_into_its_halo_without_a_step(approach_mm):
    ball = Surface(3.0, 3.0)
    distance_mm = np.linspace(0, 8, 1601, dtype=np.float32)[None]
    dent = dent_mm(ball.gap_mm(np.square(distance_mm / 3.0)), approach_mm, ball, Gel())[0]
    assert dent[0] == pytest.approx(approach_mm)
    assert (np.diff(dent) <= 1e-6).all()
    assert np.abs(np.diff(dent)).max() < 0.0085
    assert dent[-1] < 0.02 * approach_mm


def test_hertzs_halo_has_its_known_values():
    ratio_squared = np.array([1.0, 4.0], np.float32)
    # At twice the radius: (-2·asin(1/2) + √3) / π, by hand.
    assert half_space_surface(ratio_squared) == pytest.approx([0.5, (np.sqrt(3) - np.pi / 3) / np.pi], abs=1e-6)


def test_nothing_touches_before_the_onset():
    fruit, gel = draw_fruit(Kind.RASPBERRY, 1), Gel()
    footprint = FruitOnGel(fruit, Pose(), gel).pressed(Squeeze(fruit, gel).at(-1.0))
    assert not footprint.dent.any()
    assert footprint.true_area_px == 0


def test_a_bruised_fruit_gives_more_area_and_less_force():
    sound, bruised = (draw_fruit(Kind.STRAWBERRY, 4, bruised=flag) for flag in (False, True))
    gel = Gel()
    areas, forces = [], []
    for fruit in (sound, bruised):
        step = Squeeze(fruit, gel).at(3.0)
        areas.append(FruitOnGel(fruit, Pose(), gel).pressed(step).true_area_px)
        forces.append(step.force_n)
    assert areas[1] > 1.2 * areas[0]
    assert forces[1] < forces[0]


def test_a_tilt_moves_the_contact():
    fruit, gel = draw_fruit(Kind.RUBBER_BALL, 0), Gel()
    step = Squeeze(fruit, gel).at(2.0)
    straight, tilted = (FruitOnGel(fruit, Pose(tilt_deg=tilt), gel).pressed(step).true_mask for tilt in (0.0, 5.0))
    shift_px = np.argwhere(tilted).mean(axis=0) - np.argwhere(straight).mean(axis=0)
    # A ball of 12 mm leant by 5 degrees touches 12·tan 5° further along the columns.
    assert shift_px == pytest.approx([0, -12 * np.tan(np.deg2rad(5)) / MM_PER_PX], abs=2)


class TestWorld:
    def placed(self, kind=Kind.STRAWBERRY):
        clock = ManualClock()
        world = World(clock)
        fruit = draw_fruit(kind, 2)
        world.place(fruit)
        return world, clock, fruit

    def test_the_onset_is_where_the_width_is_the_fruits(self):
        world, _, fruit = self.placed()
        onset_mm = DIGIT_MM + fruit.width_mm
        assert world.force_N(onset_mm + 0.01) == 0
        assert world.footprint() is None
        assert world.force_N(onset_mm - 2.0) > 0
        footprint = world.footprint()
        assert footprint is not None
        assert footprint.true_area_px > 10_000

    def test_a_holder_takes_room(self):
        world = World(ManualClock())
        world.place(draw_fruit(Kind.RUBBER_BALL, 0), holder_mm=18.0)
        assert world.force_N(DIGIT_MM + 42.5) == 0
        assert world.force_N(DIGIT_MM + 41.5) > 0

    def test_nothing_is_felt_while_the_arm_is_elsewhere(self):
        world, _, _ = self.placed()
        world.sensor_mm = lambda: None
        assert world.force_N(DIGIT_MM + 10.0) == 0
        assert world.touch() is None

    def test_a_sensor_that_moves_sees_the_contact_move_the_other_way(self):
        world, _, fruit = self.placed()
        world.force_N(DIGIT_MM + fruit.width_mm - 1.5)
        places = []
        for sensor_mm in ((0.0, 0.0), (1.0, -0.5)):
            world.sensor_mm = lambda place=sensor_mm: place
            footprint = world.footprint()
            assert footprint is not None
            rows, columns = np.nonzero(footprint.true_mask)
            places.append((columns.mean(), rows.mean()))
        (x_px, y_px), (moved_x_px, moved_y_px) = places
        assert (x_px - moved_x_px) * MM_PER_PX == pytest.approx(1.0, abs=0.05)
        assert (y_px - moved_y_px) * MM_PER_PX == pytest.approx(-0.5, abs=0.05)

    def test_a_held_fruit_creeps_and_recovers(self):
        world, clock, fruit = self.placed()
        opening_mm = DIGIT_MM + fruit.width_mm - 2.0
        at_first_n = world.force_N(opening_mm)
        clock.advance(300.0)
        assert world.force_N(opening_mm) < 0.95 * at_first_n
        world.force_N(85.0)
        clock.advance(1.0)
        assert world.force_N(opening_mm) == pytest.approx(at_first_n)

    def test_a_fruit_squeezed_beyond_its_yield_stays_softer_and_narrower(self):
        world, _, fruit = self.placed(Kind.RASPBERRY)
        before_n = world.force_N(DIGIT_MM + fruit.width_mm - 2.0)
        world.force_N(DIGIT_MM + fruit.width_mm - 12.0)
        world.force_N(85.0)
        assert world.fruit is not None
        assert world.fruit.width_mm < fruit.width_mm - 0.5
        assert world.force_N(DIGIT_MM + world.fruit.width_mm - 2.0) < 0.9 * before_n

    def test_a_gentle_squeeze_leaves_no_trace(self):
        world, _, fruit = self.placed()
        world.force_N(DIGIT_MM + fruit.width_mm - 2.0)
        world.force_N(85.0)
        assert world.fruit == fruit

    def test_an_empty_nest_pushes_nothing(self):
        world, _, _ = self.placed()
        world.remove()
        assert world.force_N(DIGIT_MM) == 0
        assert world.touch() is None
