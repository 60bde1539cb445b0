import cv2
import numpy as np
import pytest

from station.devices.camera.health import FrameHealth, find_seam
from station.devices.camera.interface import FrameFault
from station.twin.digit.press import PressOptions, render_press
from station.twin.digit.server import digit_faults
from station.twin.digit.spoil import spoiled
from station.twin.fruit import Kind
from station.twin.gel import SENSOR_SHAPE

SPOILT = {
    "frame_torn": FrameFault.TORN,
    "frame_shifted": FrameFault.SHIFTED,
    "frame_black": FrameFault.BLACK,
    "frame_saturated": FrameFault.SATURATED,
}


@pytest.fixture(scope="module")
def presses():
    """Frames of every kind of fruit on units of different light, references first."""
    return [
        render_press(kind, seed, [1.0, 5.0, 10.0], PressOptions(unit=seed or None))
        for seed in range(3)
        for kind in Kind
    ]


def test_good_frames_have_no_fault(presses):
    for press in presses:
        health, before = FrameHealth(0.2, SENSOR_SHAPE), None
        for frame in (*press.references, *press.frames):
            assert health.judge(frame, before, 0.01) == frozenset()
            before = frame


def test_real_frames_have_no_fault(real_images):
    health, before = FrameHealth(0.2, SENSOR_SHAPE), None
    for path in sorted((real_images / "digit_presses").glob("*.jpg")):
        image = np.asarray(cv2.imread(str(path)), np.uint8)
        assert health.judge(image, before, 0.0) == frozenset(), path.name
        before = image
    for path in sorted((real_images / "digit_backgrounds").glob("*.jpg")):
        image = np.asarray(cv2.imread(str(path)), np.uint8)
        assert FrameHealth(0.2, (320, 240)).judge(image, None, 0.0) == frozenset(), path.name


@pytest.mark.parametrize("fault", list(SPOILT))
def test_spoilt_frames_are_named(presses, fault):
    faults = digit_faults()
    faults.set(fault)
    named = []
    for number, press in enumerate(presses):
        health = FrameHealth(0.2, SENSOR_SHAPE)
        for reference in press.references:
            health.judge(reference, None, 0.0)
        named += [health.judge(spoiled(frame, faults, number), None, 0.0) for frame in press.frames]
    assert all(named), "each spoilt frame has some fault"
    assert sum(one == {SPOILT[fault]} for one in named) >= 0.97 * len(named)


def test_a_frame_after_bad_ones_is_good_again(presses):
    health, [reference, *_] = FrameHealth(0.2, SENSOR_SHAPE), presses[0].references
    assert not health.judge(reference, None, 0.0)
    assert health.judge(np.zeros_like(reference), reference, 0.0) == {FrameFault.BLACK}
    assert not health.judge(reference, None, 0.0)


def test_old_repeated_and_wrongly_sized_frames_are_named_together(presses):
    health, frame = FrameHealth(0.2, SENSOR_SHAPE), presses[0].frames[0]
    assert health.judge(frame, frame.copy(), 0.3) == {FrameFault.STALE, FrameFault.REPEATED}
    assert health.judge(frame[::2, ::2], None, 0.0) == {FrameFault.WRONG_SIZE}


@pytest.mark.parametrize("axis", [0, 1])
def test_a_seam_is_found_at_its_line_and_a_slope_is_none(axis):
    slope = np.broadcast_to(np.linspace(0, 250, SENSOR_SHAPE[1]), SENSOR_SHAPE)
    image = np.repeat(slope[..., None], 3, axis=2).astype(np.uint8)
    image = image if axis == 1 else np.ascontiguousarray(np.swapaxes(np.swapaxes(image, 0, 1)[:, :480], 0, 1))
    assert find_seam(image, axis) is None
    broken = image.copy()
    half = np.s_[200:] if axis == 0 else np.s_[:, 200:]
    broken[half] = np.clip(broken[half].astype(int) - 15, 0, 255)
    assert find_seam(broken, axis) == pytest.approx(200, abs=2)
