"""The contact of one width step, from all of its frames."""

import numpy as np
import pytest

from station.settings.segmentation import PaperParameters, RobustParameters
from station.vision.paper import PaperMethod
from station.vision.robust import RobustMethod
from station.vision.step import mean_image, measure_step
from station.vocabulary import Flag


def test_one_frame_is_measured_as_it_is(sphere_press):
    press = sphere_press()
    method = RobustMethod(press.reference, RobustParameters())
    alone = method.measure(press.image)
    step = measure_step(method, [press.image])
    assert (step.area_px, step.confidence, step.flags) == (alone.area_px, alone.confidence, alone.flags)


def test_frames_that_agree_keep_the_confidence_and_their_mean_is_measured(sphere_press, overlap):
    frames = [sphere_press(seed=seed).image for seed in range(3)]
    press = sphere_press()
    method = RobustMethod(press.reference, RobustParameters())
    step = measure_step(method, frames)
    assert overlap(step.mask, press.truth) > 0.85
    assert step.area_px == method.measure(mean_image(frames)).area_px
    assert step.confidence is not None
    assert step.confidence > 0.7
    assert Flag.LOW_CONFIDENCE not in step.flags


def test_frames_that_disagree_are_doubted_and_flagged(sphere_press):
    press = sphere_press()
    method = RobustMethod(press.reference, RobustParameters())
    frames = [sphere_press(radius_px=radius).image for radius in (40, 70, 100)]
    step = measure_step(method, frames)
    assert step.area_px > 0
    assert step.confidence is not None
    assert step.confidence < 0.3
    assert Flag.LOW_CONFIDENCE in step.flags


def test_a_method_without_a_confidence_stays_without(sphere_press):
    small = [np.ascontiguousarray(sphere_press(seed=seed).image[::8, ::8]) for seed in range(2)]
    method = PaperMethod(small[0], PaperParameters())
    assert measure_step(method, small).confidence is None


def test_the_mean_is_rounded():
    frames = [np.full((2, 2, 3), level, np.uint8) for level in (255, 254, 254)]
    assert (mean_image(frames) == 254).all()
    assert mean_image(frames[:2]).max() == 255


def test_a_step_without_frames_is_refused(sphere_press):
    method = RobustMethod(sphere_press().reference, RobustParameters())
    with pytest.raises(ValueError, match="at least one"):
        measure_step(method, [])


class Counting:
    """A method that counts its measurements."""

    def __init__(self, method):
        self.method, self.stages, self.measured = method, method.stages, []

    def measure(self, image, on_stage=None, previous=None, agreed=1.0, *, firm_only=False):
        self.measured.append((image, previous))
        return self.method.measure(image, on_stage, previous, agreed, firm_only=firm_only)


def test_frames_that_are_measured_already_are_not_measured_again(sphere_press):
    frames = [sphere_press(seed=seed).image for seed in range(3)]
    method = RobustMethod(sphere_press().reference, RobustParameters())
    counting = Counting(method)
    known = {id(frame): method.measure(frame) for frame in frames[:2]}
    step = measure_step(counting, frames, known=known)
    whole = measure_step(method, frames)
    assert len(counting.measured) == 2
    assert counting.measured[0][0] is frames[2]
    assert (step.area_px, step.confidence, step.flags) == (whole.area_px, whole.confidence, whole.flags)


def test_a_lone_frame_that_is_measured_already_is_not_measured_again(sphere_press):
    frame = sphere_press().image
    method = RobustMethod(sphere_press().reference, RobustParameters())
    counting = Counting(method)
    contact = measure_step(counting, [frame], known={id(frame): method.measure(frame)})
    assert contact.found
    assert counting.measured == []


def test_every_measurement_of_a_step_follows_the_step_before(sphere_press):
    frames = [sphere_press(seed=seed).image for seed in range(3)]
    counting = Counting(RobustMethod(sphere_press().reference, RobustParameters()))
    before = counting.method.measure(frames[0])
    measure_step(counting, frames, before)
    assert len(counting.measured) == 4
    assert all(previous is before for _, previous in counting.measured)
