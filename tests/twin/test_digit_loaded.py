"""Light of a loaded gel, debris that moves, and compressed frames; all off by default."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.measurement.video import with_video
from station.twin.digit.codec import as_jpeg
from station.twin.digit.debris import moved, scattered
from station.twin.digit.loaded import LoadedLight, band_share
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.gel import GRID_MM, GRID_SHAPE, SENSOR_SHAPE


def flat(depth_mm):
    return np.full(GRID_SHAPE, depth_mm, np.float32)


@pytest.fixture(scope="module")
def sensor():
    return DigitSensor(3, noise=0.0, drift=0.0)


def test_a_flat_gel_changes_nothing_by_default(sensor):
    untouched = sensor.frame(None, 0.0)
    assert np.array_equal(sensor.frame(flat(0.3), 0.0), untouched)
    loaded = Condition(bands=40.0, depth_shade=20.0)
    assert np.array_equal(sensor.frame(None, 0.0, loaded), untouched)
    assert not np.array_equal(sensor.frame(flat(0.3), 0.0, loaded), untouched)


def test_nothing_new_draws_from_the_noise():
    plain, loaded = DigitSensor(5), DigitSensor(5)
    loaded.frame(flat(0.2), 0.0, Condition(bands=30.0, depth_shade=10.0, dirt=2, dirt_moved=4, jpeg_quality=50))
    plain.frame(flat(0.2), 0.0)
    assert np.array_equal(plain.frame(None, 0.1), loaded.frame(None, 0.1))


def test_bands_lie_along_the_border_and_brighten_with_the_load(sensor):
    untouched, condition = sensor.frame(None, 0.0).astype(float), Condition(bands=40.0)
    sizes = []
    for push_mm in (0.005, 0.05, 0.3):
        change = sensor.frame(flat(push_mm), 0.0, condition) - untouched
        border = np.concatenate([change[:, :8].reshape(-1, 3), change[:, -8:].reshape(-1, 3)])
        sizes.append(np.percentile(border, 99))
        assert np.abs(change[220:420, 160:320]).max() <= 1
    assert 1 <= sizes[0] < sizes[1] < sizes[2] <= 41
    assert sizes[2] > 10


def test_a_band_rises_without_a_step_and_ends():
    shares = [band_share(push_mm) for push_mm in np.linspace(0.0, 2.0, 400)]
    assert shares[0] == 0
    assert np.all(np.diff(shares) > 0)
    assert 0.99 < shares[-1] <= 1


def test_bands_differ_by_colour_side_and_unit():
    one, other = (LoadedLight(unit).bands(flat(1.0), 1.0) for unit in (None, 4))
    assert np.abs(one - other).max() > 0.2
    left, right = one[:, 0].mean(axis=0), one[:, -1].mean(axis=0)
    assert np.abs(left - right).max() > 0.05
    assert np.ptp(left) > 0.05


def test_a_flat_dent_changes_with_its_depth(sensor):
    untouched, condition = sensor.frame(None, 0.0).astype(float), Condition(depth_shade=20.0)
    shallow, deep = (sensor.frame(flat(depth_mm), 0.0, condition) - untouched for depth_mm in (0.2, 0.6))
    assert 2 < np.abs(shallow).max() < 12
    assert 2 < np.abs(deep).mean() / np.abs(shallow).mean() < 4


@pytest.mark.parametrize("seed", range(20))
def test_debris_moves_by_one_to_three_millimetres_or_goes(seed):
    before = scattered(8, np.random.default_rng(seed))
    after = moved(before, np.random.default_rng([seed, 1]))
    assert after == moved(before, np.random.default_rng([seed, 1]))
    assert after[0] != before[0]
    steps_mm = []
    for speck in after:
        assert 0 <= speck.x <= GRID_SHAPE[1]
        assert 0 <= speck.y <= GRID_SHAPE[0]
        same = [one for one in before if (one.radius, one.depth_mm) == (speck.radius, speck.depth_mm)]
        if same and same[0] != speck:
            steps_mm.append(np.hypot(speck.x - same[0].x, speck.y - same[0].y) * GRID_MM)
    assert steps_mm
    assert all(0.9 < step_mm < 3.1 for step_mm in steps_mm)


def test_moved_debris_shows_in_the_frame(sensor):
    stays = Condition(dirt=4)
    before, after = (sensor.frame(None, 0.0, one).astype(float) for one in (stays, replace(stays, dirt_moved=7)))
    change = np.abs(before - after).max(axis=2)
    assert change.max() > 20
    assert np.mean(change > 5) < 0.05


def test_jpeg_is_coarser_at_a_lower_quality(sensor):
    frame = DigitSensor(1).frame(None, 0.0)
    errors = [np.abs(as_jpeg(frame, quality).astype(float) - frame).mean() for quality in (95, 60, 30)]
    assert 0 < errors[0] < errors[1] < errors[2] < 6
    compressed = DigitSensor(1).frame(None, 0.0, Condition(jpeg_quality=30))
    assert np.array_equal(compressed, as_jpeg(frame, 30))


@pytest.mark.parametrize(("codec", "quality"), [("mp4v", None), ("MJPG", 20)])
def test_a_video_gives_back_as_many_frames(codec, quality):
    noisy = DigitSensor(2)
    frames = [noisy.frame(None, index / 30) for index in range(5)]
    decoded = with_video(frames, codec, quality)
    assert [frame.shape for frame in decoded] == [(*SENSOR_SHAPE, 3)] * 5
    assert 0.5 < np.abs(np.subtract(decoded, frames, dtype=np.float32)).mean() < 6


def test_no_frames_give_no_video():
    assert with_video([]) == []
