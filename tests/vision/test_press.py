"""Press tracker: a press is one measurement, whose contact does not fall while the compression rises."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from benchmarks.measurement.soft.body import Foundation, SoftBody, SoftKind
from benchmarks.measurement.soft.contact import SoftOnGel
from station.settings.segmentation import RobustParameters
from station.twin.contact import Pose
from station.twin.digit.loaded import band_share
from station.twin.digit.press import render_press
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import draw_fruit
from station.vision.median import median_image
from station.vision.press import PressTracker
from station.vision.robust import RobustMethod
from station.vocabulary import Flag

PARAMETERS = RobustParameters()
SEEDS = range(4)
FILLED = 0.9
"""Of the field: beyond it the border cuts nearly all of the edge."""
COVERED = (0.0, 0.06, 0.12, 0.2, 0.3, 0.42, 0.55, 0.68, 0.8, FILLED, 0.97, 1.0)
BANDS_LEVELS = 30.0
"""Of the border at the press's end, as the whole gel is pushed towards its LEDs."""


class Step(NamedTuple):
    frames: list
    truth: np.ndarray


class SoftPress(NamedTuple):
    references: list
    steps: list[Step]

    def tracker(self):
        return PressTracker(RobustMethod(median_image(self.references), PARAMETERS))


def drawn(seed):
    """A soft body of the twin that comes to fill the field, its place, and the sensor's unit."""
    generator = np.random.default_rng(seed)
    foundation = Foundation(generator.uniform(0.06, 0.1), generator.uniform(0.1, 0.2), 0.2)
    radius_mm = generator.uniform(15, 30)
    body = SoftBody(SoftKind.SMOOTH_FRUIT, seed, (radius_mm, radius_mm * generator.uniform(1.0, 1.4)), foundation)
    pose = Pose(240 + generator.uniform(-50, 50), 320 + generator.uniform(-50, 50))
    return SoftOnGel(body, pose), DigitSensor(seed, 500 + seed)


def press(seed, covered=COVERED, bands_levels=BANDS_LEVELS):
    contact, sensor = drawn(seed)
    references = [sensor.frame(None, number / 30) for number in range(5)]
    end_mm = contact.compression_mm(1.0)
    bands = bands_levels / band_share(float(contact.pressed(end_mm).dent.mean()))
    condition = Condition(bands=bands, depth_shade=4.0)
    steps = []
    for number, share in enumerate(covered):
        seen = contact.pressed(contact.compression_mm(share) if share else 0.0)
        dent = seen.dent if share else None
        frames = [sensor.frame(dent, 1.0 + number + frame / 30, condition) for frame in range(3)]
        steps.append(Step(frames, seen.true_mask))
    return SoftPress(references, steps)


@pytest.fixture(scope="module")
def presses():
    return [press(seed) for seed in SEEDS]


@pytest.fixture(scope="module")
def followed(presses):
    """The contacts of each press's steps, in order."""
    found = []
    for one in presses:
        tracker = one.tracker()
        found.append([tracker.measure_step(step.frames) for step in one.steps])
    return found


@pytest.fixture(scope="module")
def alone(presses):
    """The same steps, each measured by itself."""
    return [[one.tracker().measure_step(step.frames) for step in one.steps] for one in presses]


def trusted(contact):
    return contact.found and Flag.LOW_CONFIDENCE not in contact.flags


def largest_falls(found):
    """By which share of an earlier area each press falls at most, from its first trusted step on."""
    falls = []
    for contacts in found:
        first = next(number for number, contact in enumerate(contacts) if trusted(contact))
        areas = np.array([contact.area_px for contact in contacts[first:]])
        falls.append(float((1 - areas / np.maximum.accumulate(areas)).max()))
    return falls


def errors(presses, found, below=1.0):
    """The relative errors of all trusted steps that cover less than a share of the field."""
    return [
        abs(contact.area_px / np.count_nonzero(step.truth) - 1)
        for one, contacts in zip(presses, found, strict=True)
        for step, contact in zip(one.steps, contacts, strict=True)
        if trusted(contact) and step.truth.any() and np.mean(step.truth > 0) < below
    ]


def test_the_area_of_a_press_does_not_fall(followed):
    assert max(largest_falls(followed)) < 0.01


def test_it_stays_close_to_the_truth_while_the_edge_is_in_the_field(presses, followed):
    found = errors(presses, followed, FILLED + 0.02)
    assert len(found) > 5 * len(SEEDS)
    assert max(found) < 0.1


def test_once_the_edge_has_left_the_field_the_area_is_flagged_as_a_lower_bound_or_unsure_or_is_right(presses, followed):
    for one, contacts in zip(presses, followed, strict=True):
        for step, contact in zip(one.steps, contacts, strict=True):
            if np.mean(step.truth > 0) > FILLED:
                right = contact.area_px == pytest.approx(np.count_nonzero(step.truth), rel=0.1)
                assert right or contact.flags & {Flag.LOWER_BOUND, Flag.LOW_CONFIDENCE}


def test_the_last_step_is_no_more_than_the_field_and_no_less_than_what_was_seen(followed):
    for contacts in followed:
        assert contacts[-1].area_px > 0.8 * contacts[-1].mask.size
        assert Flag.CUT_BY_BORDER in contacts[-1].flags


def test_without_following_the_same_images_fall(followed, alone):
    assert np.median(largest_falls(alone)) > 4 * np.median(largest_falls(followed))


def test_a_lower_bound_is_no_more_than_the_truth(presses, followed):
    for one, contacts in zip(presses, followed, strict=True):
        for step, contact in zip(one.steps, contacts, strict=True):
            if Flag.LOWER_BOUND in contact.flags:
                assert contact.area_px < 1.05 * np.count_nonzero(step.truth)


def test_bands_at_the_border_that_brighten_with_the_load_are_background_and_no_contact():
    for seed in SEEDS:
        _, sensor = drawn(seed)
        method = RobustMethod(median_image([sensor.frame(None, number / 30) for number in range(5)]), PARAMETERS)
        tracker = PressTracker(method)
        # The dent is wide and even, as of a gel that is pushed as a whole: nothing of it is an edge.
        for number, bands_levels in enumerate((5.0, 15.0, 30.0)):
            even = np.full((320, 240), 0.3, np.float32)
            condition = Condition(bands=bands_levels / band_share(0.3))
            frames = [sensor.frame(even, 1.0 + number + frame / 30, condition) for frame in range(3)]
            contact = tracker.measure_step(frames)
            assert not trusted(contact)


def test_bands_do_not_change_the_area_of_a_contact_beside_them():
    for seed in SEEDS:
        areas = []
        for bands_levels in (0.0, BANDS_LEVELS):
            one = press(seed, (0.2,), bands_levels)
            areas.append(one.tracker().measure_step(one.steps[0].frames).area_px)
        assert areas[1] == pytest.approx(areas[0], rel=0.1)


def test_a_body_that_is_let_go_is_released(presses, followed):
    for one, contacts in zip(presses, followed, strict=True):
        tracker = one.tracker()
        for step in one.steps:
            tracker.measure_step(step.frames)
        opened = tracker.measure_step(one.steps[0].frames)
        assert opened.area_px < 0.1 * contacts[-1].area_px
        assert Flag.LOWER_BOUND not in opened.flags


def test_opening_again_is_a_new_press_with_a_new_tracker(presses, followed):
    for one, contacts in zip(presses, followed, strict=True):
        less = one.tracker().measure_step(one.steps[4].frames)
        assert less.area_px == pytest.approx(contacts[4].area_px, rel=0.1)
        assert less.area_px < 0.5 * contacts[8].area_px


class Counting:
    """A method that counts its measurements."""

    def __init__(self, method):
        self.method, self.stages, self.measured = method, method.stages, []

    def measure(self, image, on_stage=None, previous=None, agreed=1.0, *, firm_only=False):
        self.measured.append(previous)
        return self.method.measure(image, on_stage, previous, agreed, firm_only=firm_only)


@pytest.mark.parametrize("frames", [3, 1])
def test_a_frame_that_is_measured_ahead_is_not_measured_again(presses, frames):
    one = presses[0]
    counting = Counting(RobustMethod(median_image(one.references), PARAMETERS))
    ahead, plain = PressTracker(counting), one.tracker()
    for step in one.steps[2:5]:
        taken = step.frames[:frames]
        ahead.prepare_next(taken[0])
        found, expected = ahead.measure_step(taken), plain.measure_step(taken)
        assert (found.area_px, found.confidence, found.flags) == (expected.area_px, expected.confidence, expected.flags)
    assert len(counting.measured) == 3 * (frames + (frames > 1))


def test_a_press_may_go_on_from_a_contact_that_an_approach_has_measured(presses, followed):
    one = presses[0]
    approach = one.tracker().measure_step(one.steps[4].frames)
    method = RobustMethod(median_image(one.references), PARAMETERS)
    tracker = PressTracker(method, first=approach)
    for step, contact in zip(one.steps[5:], followed[0][5:], strict=True):
        assert tracker.measure_step(step.frames).area_px == pytest.approx(contact.area_px, rel=0.1)


@pytest.mark.parametrize(("kind", "most"), [("blueberry", 1.02), ("rubber_ball", 1.02), ("raspberry", 1.08)])
def test_a_fruit_at_rest_does_not_grow_from_step_to_step(kind, most):
    seen = render_press(kind, 7, (3.0,) * 8)
    method = RobustMethod(median_image(seen.references), PARAMETERS)
    tracker = PressTracker(method)
    followed = [tracker.measure_step([frame]) for frame in seen.frames]
    alone_px = [method.measure(frame).area_px for frame in seen.frames]
    assert all(Flag.LOW_CONFIDENCE not in contact.flags for contact in followed)
    assert followed[-1].area_px == pytest.approx(max(alone_px), rel=most - 1)


def test_each_tracker_follows_its_own_press(presses):
    one, other = presses[:2]
    trackers = [press.tracker() for press in (one, other)]
    both = [
        [tracker.measure_step(press.steps[number].frames).area_px for number in (3, 6, 9)]
        for tracker, press in zip(trackers, (one, other), strict=True)
    ]
    again = [
        [tracker.measure_step(press.steps[number].frames).area_px for number in (3, 6, 9)]
        for tracker, press in zip([press.tracker() for press in (one, other)], (one, other), strict=True)
    ]
    assert both == again


def test_a_doubtful_step_returns_at_least_what_the_step_before_did_until_the_body_is_let_go():
    doubting = RobustParameters(least_confidence=1.0)
    one = press(0, covered=(0.3, 0.25, 0.0))
    tracker = PressTracker(RobustMethod(median_image(one.references), doubting))
    larger, smaller, released = (tracker.measure_step(step.frames[:1]) for step in one.steps)
    assert Flag.LOW_CONFIDENCE in larger.flags
    assert Flag.LOWER_BOUND not in larger.flags
    assert not np.any((larger.mask > 0) & (smaller.mask == 0))
    assert {Flag.LOWER_BOUND, Flag.LOW_CONFIDENCE} <= smaller.flags
    assert not released.found


def test_a_step_whose_frames_disagree_is_doubtful_and_returns_at_least_what_the_step_before_did():
    one = press(0, covered=(0.3, 0.55, 0.68))
    tracker = one.tracker()
    before = tracker.measure_step(one.steps[0].frames)
    mixed = tracker.measure_step([step.frames[0] for step in one.steps])
    assert Flag.LOW_CONFIDENCE not in before.flags
    assert {Flag.LOW_CONFIDENCE, Flag.LOWER_BOUND} <= mixed.flags
    assert not np.any((before.mask > 0) & (mixed.mask == 0))


def test_the_area_of_a_body_too_faint_for_an_edge_rises_with_what_has_changed():
    foam = SoftBody(SoftKind.FOAM, 3, (40.0, 40.0), Foundation(plateau_mpa=0.02, knee_mm=0.2, hardening_per_mm=0.2))
    contact, sensor = SoftOnGel(foam, Pose(240, 320)), DigitSensor(3, 503)
    references = [sensor.frame(None, number / 30) for number in range(5)]
    tracker = PressTracker(RobustMethod(median_image(references), PARAMETERS))
    found = []
    for number, share in enumerate(COVERED[4:-2]):
        dent = contact.pressed(contact.compression_mm(share)).dent
        frames = [sensor.frame(dent, 1.0 + number + k / 30, Condition(depth_shade=10.0)) for k in range(3)]
        found.append(tracker.measure_step(frames))
    assert all(one.flags & {Flag.LOW_CONFIDENCE, Flag.UNDECIDED} for one in found)
    assert np.all(np.diff([one.area_px for one in found]) > 0)


def test_a_soft_fruit_without_a_trusted_edge_is_returned_as_large_as_it_is_drawn_and_not_as_what_has_changed():
    soft = replace(draw_fruit("strawberry", 20_000), bruised=True)
    seen = render_press(soft, 20_000, (0.1, 0.2, 0.4, 0.8))
    tracker = PressTracker(RobustMethod(median_image(seen.references), PARAMETERS))
    found = [tracker.measure_step([frame]) for frame in seen.frames][2:]
    assert all({Flag.LOW_CONFIDENCE, Flag.LOWER_BOUND} <= one.flags for one in found)
    assert all(one.changed_area_px is not None and one.changed_area_px < 0.1 * one.area_px for one in found)
    truths_px = [np.count_nonzero(mask) for mask in seen.true_masks[2:]]
    assert [one.area_px for one in found] == pytest.approx(truths_px, rel=0.4)
