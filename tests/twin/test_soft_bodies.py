"""Soft, textured, hollow and long bodies on the gel, and the presses that the benchmarks make of them."""

import numpy as np
import pytest

from benchmarks.measurement.soft.body import Foundation, SoftBody, SoftKind, draw_soft_body
from benchmarks.measurement.soft.contact import SoftOnGel
from benchmarks.measurement.soft.skin import Skin, relief
from benchmarks.measurement.soft_bodies import (
    FILLING,
    KINDS,
    moved_specks,
    other_unit_pairs,
    press_with_other_reference,
    press_with_video,
    soft_press,
    soft_presses,
    with_jpeg,
)
from station.twin.contact import Pose
from station.twin.gel import GRID_SHAPE, SENSOR_SHAPE

FIELD_PX = SENSOR_SHAPE[0] * SENSOR_SHAPE[1]
BALL = SoftBody(SoftKind.SOFT_BALL, 0, (20.0, 20.0), Foundation(0.03, 0.1, 0.1))


def change_of(frames, references):
    return np.mean(frames, axis=0) - np.mean(references, axis=0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_area_force_and_dent_rise_with_the_compression(kind, seed):
    contact = SoftOnGel(draw_soft_body(kind, seed))
    footprints = [contact.pressed(compression_mm) for compression_mm in (0.02, 0.1, 0.3, 0.7, 1.3)]
    for name in ("true_area_px", "force_n"):
        assert np.all(np.diff([getattr(one, name) for one in footprints]) > 0), name
    assert np.all(np.diff([one.dent.mean() for one in footprints]) > 0)


@pytest.mark.parametrize("kind", KINDS)
def test_before_the_first_touch_there_is_nothing(kind):
    footprint = SoftOnGel(draw_soft_body(kind, 1)).pressed(0.0)
    assert not footprint.dent.any()
    assert footprint.true_area_px == footprint.force_n == 0
    assert footprint.dent.shape == GRID_SHAPE
    assert footprint.dent.dtype == np.float32


def test_a_soft_ball_presses_a_flat_plateau_with_a_rounded_rim():
    contact = SoftOnGel(BALL)
    footprint = contact.pressed(contact.compression_mm(0.4))
    radius_px = np.sqrt(footprint.true_area_px / np.pi)
    row = footprint.dent[GRID_SHAPE[0] // 2, GRID_SHAPE[1] // 2 :]
    half_way = int(0.25 * radius_px)  # of the grid's points, two pixels each
    assert row[half_way] > 0.85 * row[0]  # Hertz's would have 0.75
    assert row[int(0.5 * radius_px)] < 0.3 * row[0]
    assert 0.1 < row[0] < 0.8


def test_soft_bodies_come_to_cover_the_field():
    contact = SoftOnGel(BALL)
    for covered in (0.3, 0.8, 1.0):
        area_px = contact.pressed(contact.compression_mm(covered)).true_area_px
        assert area_px == pytest.approx(covered * FIELD_PX, rel=0.02)


def test_a_ring_is_hollow_until_its_inside_touches():
    foundation = Foundation(1.0, 0.5, 1.0)
    cup = SoftBody(SoftKind.RING, 0, (3.0, 0.7), foundation, recess_mm=0.4)
    contact = SoftOnGel(cup)
    hollow, full = contact.pressed(0.3), contact.pressed(0.5)
    assert not hollow.true_mask[320, 240]
    assert hollow.true_mask[320, 240 + round(3.0 / hollow.mm_per_px)]
    assert full.true_mask[320, 240]
    assert full.true_area_px > 1.5 * hollow.true_area_px


def test_a_rod_crosses_the_field_or_ends_in_it():
    foundation = Foundation(0.5, 0.5, 0.5)
    crossing = SoftOnGel(SoftBody(SoftKind.LONG, 0, (3.0, 3.0), foundation)).pressed(0.5)
    ending = SoftOnGel(SoftBody(SoftKind.LONG, 0, (3.0, 3.0), foundation, end_mm=0.0)).pressed(0.5)
    assert crossing.true_mask[0].any()
    assert crossing.true_mask[-1].any()
    assert ending.true_mask[0].any()
    assert not ending.true_mask[-1].any()


def test_a_coarse_skin_deepens_with_the_pressure():
    skin = SoftBody(
        SoftKind.COARSE_FRUIT, 3, (25.0, 25.0), Foundation(0.08, 0.3, 0.3),
        skin=Skin.PITTED, pitch_mm=1.2, relief_mm=0.03, full_imprint_mpa=0.1,
    )  # fmt: skip
    contact = SoftOnGel(skin)
    middle = np.s_[150:170, 110:130]
    rough = [contact.pressed(mm).dent[middle] for mm in (0.15, 0.4, 1.0)]
    assert np.all(np.diff([one.std() for one in rough]) > 0)


@pytest.mark.parametrize("skin", [Skin.PITTED, Skin.ROUGH])
def test_a_skin_has_its_pitch_and_pits_are_deeper_than_cells_are_high(skin):
    heights = relief(skin, 1.0, (320, 320), 0.05, 1)
    assert heights.mean() == pytest.approx(0, abs=1e-3)
    assert heights.std() == pytest.approx(1, abs=1e-3)
    spectrum = np.square(np.abs(np.fft.fft2(heights)))
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(320, 0.05), np.fft.fftfreq(320, 0.05)))
    mean_per_mm = float((spectrum * frequency).sum() / spectrum.sum())
    assert 0.6 < mean_per_mm < 1.6
    assert (-heights.min() > 1.3 * heights.max()) == (skin is Skin.PITTED)


def test_a_smooth_skin_is_flat():
    assert not relief(Skin.SMOOTH, 1.0, (10, 10), 0.05, 1).any()


def test_the_pose_moves_the_contact():
    footprint = SoftOnGel(BALL, Pose(x_px=140.0, y_px=420.0)).pressed(0.3)
    rows, columns = np.nonzero(footprint.true_mask)
    assert (columns.mean(), rows.mean()) == pytest.approx((140, 420), abs=1)


def test_a_kind_that_there_is_not_is_refused():
    with pytest.raises(ValueError, match="brick"):
        draw_soft_body("brick", 0)


@pytest.mark.parametrize("kind", FILLING)
def test_presses_rise_to_a_full_field(kind):
    areas = [[step.true_area_px for step in press.steps] for press in soft_presses(range(6), [kind], 1, 5)]
    assert all(np.all(np.diff(area[1:]) > 0) for area in areas)
    assert all(area[0] == 0 for area in areas)
    assert np.median([area[-1] for area in areas]) > 0.7 * FIELD_PX


def test_a_press_is_the_same_for_the_same_seed():
    first, second = (soft_press("foam", 3, 2, 4) for _ in range(2))
    other = soft_press("foam", 4, 2, 4)
    assert np.array_equal(first.references, second.references)
    for one, same in zip(first.steps, second.steps, strict=True):
        assert np.array_equal(one.frames, same.frames)
        assert np.array_equal(one.true_mask, same.true_mask)
        assert (one.force_n, one.compression_mm) == (same.force_n, same.compression_mm)
    assert not np.array_equal(first.references, other.references)


def test_the_border_brightens_with_the_load():
    press = soft_press("soft_ball", 6, 3, 6)
    masks = [step.true_mask[:, :12] == 0 for step in press.steps[:-1]]
    border = [
        change_of(step.frames, press.references)[:, :12][mask].mean()
        for step, mask in zip(press.steps, masks, strict=False)
    ]
    assert border[-1] > border[2] > border[0]
    assert border[-1] > 5


def test_moved_specks_change_small_places_only():
    for references, frames in moved_specks(range(3)):
        change = np.abs(change_of(frames, references)).max(axis=2)
        assert change.max() > 15
        assert np.mean(change > 15) < 0.1


def test_another_units_reference_changes_the_whole_image():
    pair = next(other_unit_pairs([0]))
    assert np.abs(change_of(pair.frames, pair.references)).mean() > 8
    press = soft_press("ring", 0, 1, 3)
    swapped = press_with_other_reference(press)
    assert swapped.steps is press.steps
    assert np.abs(change_of(swapped.references, press.references)).mean() > 8


def test_debris_moves_under_a_press():
    clean, dirty = (soft_press("ring", 2, 1, 3, debris=debris) for debris in (0, 4))
    speck = np.abs(change_of(dirty.references, clean.references)).max(axis=2) > 15
    assert 0 < speck.mean() < 0.05
    moved = np.abs(change_of(dirty.steps[0].frames, dirty.references)).max(axis=2)
    assert (moved > 20).any()


def test_compressed_presses_keep_their_frames_and_their_truth():
    press = soft_press("smooth_fruit", 1, 2, 4)
    video = press_with_video(press)
    assert [len(step.frames) for step in video.steps] == [2] * 4
    for before, after in zip(press.steps, video.steps, strict=True):
        assert after.true_area_px == before.true_area_px
        error = np.abs(np.subtract(after.frames, before.frames, dtype=np.float32)).mean()
        assert 0.5 < error < 6
    coarse, fine = (np.abs(change_of(with_jpeg(press.references, q), press.references)).mean() for q in (30, 95))
    assert coarse > fine
