"""The robust method: golden spheres, presses of the twin, drift without a contact, real presses."""

import csv
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.measurement.soft.body import Foundation, SoftBody, SoftKind
from benchmarks.measurement.soft.contact import SoftOnGel
from station.settings.segmentation import RobustParameters
from station.studies.cohort import member
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.loaded import band_share
from station.twin.digit.press import PressOptions, render_press
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import draw_fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze
from station.vision.constants import CONSTANTS
from station.vision.median import median_image
from station.vision.robust import STAGES, RobustMethod
from station.vision.step import mean_image
from station.vocabulary import Flag

FEW = settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def read(path):
    image = cv2.imread(path)
    assert image is not None
    return np.asarray(image, np.uint8)


def measure(reference, image, **parameters):
    return RobustMethod(reference, RobustParameters(**parameters)).measure(image)


def ratios(presses, place=-1):
    """Areas over the truth's of one step of some presses, each measured as a single image."""
    found = []
    for press in presses:
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[place])
        found.append(contact.area_px / np.count_nonzero(press.true_masks[place]))
    return found


@FEW
@given(
    where=st.fixed_dictionaries(
        {"x_px": st.floats(110, 370), "y_px": st.floats(110, 530), "radius_px": st.floats(40, 80)}
    ),
    levels=st.floats(30, 70),
    seed=st.integers(0, 1000),
)
def test_the_edge_of_a_sphere_anywhere(sphere_press, overlap, where, levels, seed):
    press = sphere_press(**where, levels=levels, seed=seed)
    contact = measure(press.reference, press.image)
    assert overlap(contact.mask, press.truth) > 0.85
    assert contact.area_px == pytest.approx(np.count_nonzero(press.truth), rel=0.12)
    assert contact.centroid_px == pytest.approx((where["x_px"], where["y_px"]), abs=4)
    assert contact.confidence is not None
    assert contact.confidence > 0.5


@FEW
@given(turn=st.sampled_from(["left to right", "upside down", "transposed"]), seed=st.integers(0, 1000))
def test_the_mask_turns_with_the_images(sphere_press, overlap, turn, seed):
    press = sphere_press(170, 400, 65, seed=seed)
    turned = {
        "left to right": lambda image: np.ascontiguousarray(image[:, ::-1]),
        "upside down": lambda image: np.ascontiguousarray(image[::-1]),
        "transposed": lambda image: np.ascontiguousarray(image.swapaxes(0, 1)),
    }[turn]
    straight = measure(press.reference, press.image).mask
    contact = measure(turned(press.reference), turned(press.image))
    assert overlap(contact.mask, turned(straight) > 0) > 0.93


@FEW
@given(offset=st.tuples(*[st.integers(-20, 20)] * 3), gain=st.floats(0.85, 1.15))
def test_exposure_does_not_change_the_area(sphere_press, overlap, offset, gain):
    press = sphere_press()
    brighter = np.clip(np.rint(press.image * gain + offset), 0, 255).astype(np.uint8)
    assert overlap(measure(press.reference, brighter).mask, press.truth) > 0.85


@pytest.mark.parametrize("shape", [(320, 240), (240, 320), (480, 640), (1280, 960)])
def test_the_area_scales_with_the_image(sphere_press, overlap, shape):
    scale = max(shape) / 640
    press = sphere_press(shape[1] * 0.45, shape[0] * 0.55, 70 * scale, shape=shape)
    assert overlap(measure(press.reference, press.image).mask, press.truth) > 0.85


@FEW
@given(seed=st.integers(0, 10_000))
def test_noise_alone_is_no_contact(sphere_press, seed):
    press = sphere_press(levels=0.0, seed=seed)
    contact = measure(press.reference, press.image)
    assert contact.area_px == 0
    assert contact.flags == {Flag.NO_CONTACT}
    assert contact.gate is not None
    assert contact.gate < 1


def test_one_frame_against_itself_is_no_contact(sphere_press):
    reference = sphere_press().reference
    assert measure(reference, reference).flags == {Flag.NO_CONTACT}


@pytest.mark.parametrize(("level", "flag"), [(0, Flag.REFERENCE_MISMATCH), (255, Flag.SATURATED)])
def test_a_black_or_white_frame_is_no_contact_and_says_so(sphere_press, level, flag):
    reference = sphere_press().reference
    contact = measure(reference, np.full_like(reference, level))
    assert contact.area_px == 0
    assert {Flag.NO_CONTACT, Flag.REFERENCE_MISMATCH, flag} <= contact.flags


def test_a_contact_over_most_of_the_frame_survives_the_normalisation(sphere_press, overlap):
    press = sphere_press(radius_px=215, levels=60)
    assert np.count_nonzero(press.truth) > 0.45 * press.truth.size
    assert overlap(measure(press.reference, press.image).mask, press.truth) > 0.85


def test_a_contact_cut_by_the_border_is_a_lower_bound(sphere_press, overlap):
    press = sphere_press(x_px=20, radius_px=80)
    contact = measure(press.reference, press.image)
    assert Flag.CUT_BY_BORDER in contact.flags
    assert overlap(contact.mask, press.truth) > 0.75


@pytest.mark.parametrize("closing_mm", [5.0, 7.0])
@pytest.mark.parametrize(("x_px", "y_px"), [(0, 320), (30, 320), (450, 320), (240, 40)])
def test_of_a_large_contact_that_the_border_cuts_the_visible_part_is_measured(x_px, y_px, closing_mm):
    options = PressOptions(pose=Pose(x_px, y_px))
    presses = [render_press("blueberry", seed, (closing_mm,), options) for seed in range(2600, 2605)]
    for press in presses:
        assert Flag.CUT_BY_BORDER in measure(press.references[0], press.frames[0]).flags
    assert np.median(ratios(presses)) == pytest.approx(1, abs=0.12)


def test_a_contact_as_wide_as_the_image_ends_at_its_upper_border():
    options = PressOptions(pose=Pose(225, 295), unit=50000)
    presses = [render_press("blueberry", seed, (10.0,), options) for seed in range(50000, 50005)]
    assert np.median(ratios(presses)) == pytest.approx(1, abs=0.1)


def test_two_contacts_are_found_where_the_recipe_expects_several(sphere_press, overlap):
    one = sphere_press(130, 180, 60)
    other = sphere_press(340, 460, 60, seed=2)
    both = np.clip(one.image.astype(int) + other.image - other.reference, 0, 255).astype(np.uint8)
    truth = one.truth | other.truth
    assert overlap(measure(one.reference, both, contacts="several").mask, truth) > 0.8
    assert overlap(measure(one.reference, both, contacts="one").mask, truth) < 0.6


def test_what_opens_the_gate_without_an_edge_is_undecided_and_never_sure(sphere_press):
    press = sphere_press(levels=0.0)
    shade = cv2.GaussianBlur(cv2.circle(np.zeros((640, 480), np.float32), (200, 300), 25, 1.0, -1), (0, 0), 6)
    dirty = (press.image * (1 - 0.5 * shade[..., None])).astype(np.uint8)
    contact = measure(press.reference, dirty)
    assert contact.area_px == 0
    assert contact.gate is not None
    assert contact.gate > 1
    assert contact.flags == {Flag.UNDECIDED, Flag.LOW_CONFIDENCE}
    assert contact.confidence == 0


def test_no_contact_is_the_less_sure_the_nearer_the_gate(sphere_press):
    presses = [sphere_press(radius_px=150, levels=levels) for levels in (0.0, 9.0, 12.0)]
    given = [measure(press.reference, press.image) for press in presses]
    assert [contact.area_px for contact in given] == [0, 0, 0]
    confidences = [contact.confidence or 0.0 for contact in given]
    assert confidences == sorted(confidences, reverse=True)
    assert confidences[0] == 1
    assert confidences[-1] < 0.5


@pytest.mark.parametrize("closing_mm", [7.0, 8.0])
def test_a_large_soft_contact_that_curves_the_gel_little_is_whole(closing_mm):
    presses = [render_press("rubber_ball", seed, (closing_mm,)) for seed in range(5)]
    gates = [
        RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0]).gate
        for press in presses
    ]
    assert np.median([gate or 0.0 for gate in gates]) < 2
    assert np.median(ratios(presses)) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize("unit", [1, 9, 17])
def test_a_firm_ball_that_leaves_little_background_is_whole_and_sure(unit):
    """Its curvature alone reaches no threshold, but much of the frame has moved far."""
    ball = replace(draw_fruit("rubber_ball", 0), width_mm=38.0, length_mm=38.0)
    press = render_press(ball, unit, (6.7,), PressOptions(unit=unit))
    contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
    assert contact.flags == frozenset()
    assert contact.area_px == pytest.approx(press.true_masks[0].sum() / 255, rel=0.05)


@pytest.mark.parametrize(("kind", "closing_mm", "rel"), [("strawberry", 3.0, 0.2), ("raspberry", 4.0, 0.15)])
def test_a_bruised_fruit_over_half_of_the_field_is_whole(kind, closing_mm, rel):
    presses = [render_press(draw_fruit(kind, seed, bruised=True), seed, (closing_mm,)) for seed in range(900, 905)]
    assert np.median([press.true_masks[0].mean() / 255 for press in presses]) > 0.45
    assert np.median(ratios(presses)) == pytest.approx(1, abs=rel)


def test_a_contact_that_fills_the_field_is_a_lower_bound_and_not_sure():
    press = render_press(draw_fruit("strawberry", 900, bruised=True), 900, (12.0,))
    assert press.true_masks[0].mean() > 0.99 * press.true_masks[0].max()
    contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
    assert contact.area_px > 0.8 * press.true_masks[0].size
    assert {Flag.CUT_BY_BORDER, Flag.LOW_CONFIDENCE} <= contact.flags


@pytest.mark.parametrize(
    ("kind", "number", "from_mm2", "rel"),
    [
        ("rubber_ball", 11, 85, 0.1),
        ("strawberry", 298, 120, 0.35),
        ("raspberry", 14, 110, 0.2),
        ("blueberry", 27, 20, 0.1),
    ],
)
def test_a_contact_that_leaves_hardly_any_background_ends_at_its_edge(kind, number, from_mm2, rel):
    found = []
    for one in range(number, number + 3):
        press = member(kind, 2025, one).press()
        method = RobustMethod(median_image(press.references), RobustParameters())
        truths = [np.count_nonzero(mask) for mask in press.true_masks]
        deep = [place for place, truth in enumerate(truths) if truth * MM_PER_PX**2 > from_mm2]
        found += [method.measure(press.frames[place]).area_px / truths[place] for place in deep]
    assert len(found) >= 3
    assert np.median(found) == pytest.approx(1.0, abs=rel)


def test_a_contact_of_which_the_border_cuts_only_the_halo_ends_at_its_edge():
    found = []
    for number, image in ((91, 11), (148, 13), (262, 14)):
        press = member("blueberry", 1, number).press()
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[image])
        found.append(contact.area_px / np.count_nonzero(press.true_masks[image]))
    assert np.median(found) == pytest.approx(1, abs=0.1)


def untouched(unit, drift, after_s=3.0, dead_led=None):
    """Measure a unit of the twin some time after its reference, with nothing touching."""
    condition = Condition(dead_led=dead_led)
    sensor = DigitSensor(unit, unit, drift=drift)
    references = [sensor.frame(None, frame / 30, condition) for frame in range(5)]
    image = mean_image([sensor.frame(None, after_s + frame / 30, condition) for frame in range(3)])
    return RobustMethod(median_image(references), RobustParameters()).measure(image)


@pytest.mark.parametrize(("drift", "dead_led"), [(1.0, None), (2.0, None), (1.0, "red")])
def test_drift_is_no_contact(drift, dead_led):
    contacts = [untouched(unit, drift, dead_led=dead_led) for unit in range(31000, 31025)]
    assert sum(contact.found for contact in contacts) <= 1
    assert not any(contact.found and Flag.LOW_CONFIDENCE not in contact.flags for contact in contacts)
    for contact in contacts:
        opened = contact.gate is not None and contact.gate > 1
        assert contact.found or (Flag.UNDECIDED if opened else Flag.NO_CONTACT) in contact.flags


def weak_touch(kind, seed, without=frozenset()):
    """Measure a contact of 1 mm²; return it, and its area over the truth's."""
    fruit, gel = draw_fruit(kind, seed), Gel()
    on_gel, squeeze = FruitOnGel(fruit, Pose(), gel), Squeeze(fruit, gel)
    closings = np.geomspace(0.002, 1.0, 40)
    seen = min((on_gel.pressed(squeeze.at(float(one))) for one in closings), key=lambda one: abs(one.true_area_mm2 - 1))
    sensor = DigitSensor(seed)
    references = [sensor.frame(None, frame / 30) for frame in range(5)]
    image = mean_image([sensor.frame(seen.dent, 1.0 + frame / 30) for frame in range(3)])
    contact = RobustMethod(median_image(references), RobustParameters(), without=without).measure(image)
    return contact, contact.area_px / seen.true_area_px


@pytest.mark.parametrize("kind", ["blueberry", "raspberry", "rubber_ball"])
def test_a_touch_below_the_detection_threshold_is_found_and_not_sure(kind):
    touches = [weak_touch(kind, seed) for seed in range(500, 508)]
    assert np.median([contact.gate or 0.0 for contact, _ in touches]) < 1
    found = [(contact, ratio) for contact, ratio in touches if contact.found]
    assert len(found) >= 3
    assert 0.5 < np.median([ratio for _, ratio in found]) < 2
    for contact, _ in found:
        assert contact.is_light
        assert not contact.is_firm
        assert Flag.LOW_CONFIDENCE in contact.flags


def test_without_the_weak_contact_detector_such_a_touch_is_not_found():
    touches = [weak_touch("blueberry", seed, frozenset({"weak contact"}))[0] for seed in range(500, 504)]
    assert not any(contact.found for contact in touches)


def test_where_only_a_firm_contact_counts_a_weak_one_is_not_searched_for_and_a_firm_one_is_the_same():
    press = render_press("blueberry", 502, (0.01, 0.02, 0.04, 0.08, 2.0))
    method = RobustMethod(median_image(press.references), RobustParameters())
    kinds = set()
    for image in (press.references[0], *press.frames):
        contact, firm = method.measure(image), method.measure(image, firm_only=True)
        kinds.add((contact.found, contact.is_firm))
        assert firm.is_firm == contact.is_firm
        if contact.is_firm:
            assert (firm.area_px, firm.confidence, firm.flags) == (contact.area_px, contact.confidence, contact.flags)
            assert np.array_equal(firm.mask, contact.mask)
        else:
            assert not firm.found
    assert kinds == {(False, False), (True, False), (True, True)}


def test_of_a_contact_whose_middle_lies_at_the_border_no_wrong_area_is_judged():
    options = PressOptions(pose=Pose(257, 647), unit=20)
    for seed in range(60010, 60016):
        press = render_press("blueberry", seed, (7.0,), options)
        contact = RobustMethod(median_image(press.references), RobustParameters()).measure(press.frames[0])
        assert contact.found or Flag.UNDECIDED in contact.flags
        if Flag.LOW_CONFIDENCE not in contact.flags:
            assert contact.area_px == pytest.approx(np.count_nonzero(press.true_masks[0]), rel=0.25)


@pytest.mark.parametrize("closing_mm", [4.0, 6.5])
def test_a_calyx_is_not_taken_for_its_blueberry(closing_mm):
    fruit = [draw_fruit("blueberry", seed, bruised=True) for seed in range(7000, 7005)]
    presses = [render_press(one, 7000 + number, (closing_mm,)) for number, one in enumerate(fruit)]
    assert np.median(ratios(presses)) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize("radius_mm", [1.5, 3.0])
def test_a_cylinder_across_the_field_is_measured_along_its_length(overlap, radius_mm):
    overlaps = []
    for seed in range(5):
        turn_deg = float(np.random.default_rng(seed).uniform(0, 180))
        rod = SoftBody(SoftKind.LONG, seed, (radius_mm, radius_mm), Foundation(0.5, 0.5, 0.5))
        seen = SoftOnGel(rod, Pose(turn_deg=turn_deg)).pressed(0.5)
        sensor = DigitSensor(seed, 700 + seed)
        references = [sensor.frame(None, frame / 30) for frame in range(5)]
        contact = RobustMethod(median_image(references), RobustParameters()).measure(sensor.frame(seen.dent, 1.0))
        overlaps.append(overlap(contact.mask, seen.true_mask > 0))
    # On rays of equal length all around it was 0.2.
    assert np.median(overlaps) > 0.45


@pytest.mark.parametrize("levels", [10.0, 30.0])
def test_bands_that_brighten_at_the_border_are_no_contact(levels):
    even = np.full((320, 240), 0.3, np.float32)
    for unit in range(31000, 31008):
        sensor = DigitSensor(unit, unit)
        references = [sensor.frame(None, frame / 30) for frame in range(5)]
        condition = Condition(bands=levels / band_share(0.3))
        frames = [sensor.frame(even, 1.0 + frame / 30, condition) for frame in range(3)]
        contact = RobustMethod(median_image(references), RobustParameters()).measure(mean_image(frames))
        assert not contact.found or Flag.LOW_CONFIDENCE in contact.flags
        assert contact.area_px < 0.05 * contact.mask.size


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_can_be_left_out(sphere_press, overlap, stage):
    press = sphere_press(levels=60)
    method = RobustMethod(press.reference, RobustParameters(), without=frozenset({stage}))
    first = method.measure(press.image)
    assert overlap(first.mask, press.truth) > 0.8
    assert overlap(method.measure(press.image, previous=first).mask, press.truth) > 0.8
    assert method.measure(press.reference).area_px == 0


def test_a_stage_that_there_is_not_is_refused(sphere_press):
    with pytest.raises(ValueError, match="no such stage: polish"):
        RobustMethod(sphere_press().reference, RobustParameters(), without=frozenset({"polish"}))


def test_without_following_an_image_is_measured_by_itself(sphere_press):
    press, smaller = sphere_press(), sphere_press(radius_px=50)
    method = RobustMethod(press.reference, RobustParameters(), without=frozenset({"following"}))
    assert method.measure(smaller.image, previous=method.measure(press.image)).mask.tolist() == (
        method.measure(smaller.image).mask.tolist()
    )


def test_what_was_in_contact_at_the_last_step_still_is(sphere_press):
    press, narrower = sphere_press(levels=45), sphere_press(levels=45, radius_px=55)
    method = RobustMethod(press.reference, RobustParameters())
    first = method.measure(press.image)
    alone, followed = (method.measure(narrower.image, previous=previous) for previous in (None, first))
    assert alone.area_px < 0.75 * first.area_px
    assert followed.area_px > 0.85 * first.area_px


def test_the_changed_area_is_given_beside_the_contact_area(sphere_press):
    press = sphere_press(levels=60)
    contact, nothing = (measure(press.reference, image) for image in (press.image, press.reference))
    assert nothing.changed_area_px == 0
    assert contact.changed_area_px is not None
    assert 0.5 * contact.area_px < contact.changed_area_px < CONSTANTS.witness_most * contact.area_px


def test_other_constants_change_the_measurement(sphere_press):
    press = sphere_press(levels=60)
    strict = replace(CONSTANTS, reliable_ratio=60.0)
    fewer = RobustMethod(press.reference, RobustParameters(), strict).measure(press.image).changed_area_px
    more = measure(press.reference, press.image).changed_area_px
    assert fewer is not None
    assert more is not None
    assert fewer < more


def test_confidence_falls_with_the_contrast(sphere_press):
    given = [sphere_press(levels=levels) for levels in (60, 12, 4)]
    confidences = [measure(press.reference, press.image).confidence or 0.0 for press in given]
    assert confidences == sorted(confidences, reverse=True)
    assert confidences[0] > confidences[-1] + 0.05


@pytest.mark.parametrize(("glare", "flagged"), [((240, 320), True), ((60, 60), False)])
def test_a_contact_of_which_more_than_a_little_is_saturated_is_flagged(sphere_press, glare, flagged):
    press = sphere_press(240, 320, 90)
    reference, image = (
        cv2.circle(one.copy(), glare, 30, (255, 255, 255), cv2.FILLED) for one in (press.reference, press.image)
    )
    contact = measure(reference, image)
    assert contact.found
    assert (Flag.SATURATED in contact.flags) is flagged


def test_several_references_are_their_median(sphere_press, overlap):
    press = sphere_press()
    references = [sphere_press(seed=seed).reference for seed in range(3)]
    spoiled = np.zeros_like(press.reference)
    contact = RobustMethod(median_image([*references, spoiled]), RobustParameters()).measure(press.image)
    assert overlap(contact.mask, press.truth) > 0.85


def test_every_stage_hands_on_a_picture_of_the_image_size(sphere_press):
    press = sphere_press()
    method = RobustMethod(press.reference, RobustParameters())
    seen = {}
    method.measure(press.image, seen.__setitem__)
    assert tuple(seen) == method.stages
    assert all(picture.shape[:2] == (640, 480) and picture.dtype == np.uint8 for picture in seen.values())


def test_what_does_not_fit_the_reference_is_refused(sphere_press):
    reference = sphere_press().reference
    with pytest.raises(ValueError, match=r"uint8 image \(height, width, 3\)"):
        RobustMethod(np.asarray(reference[..., 0]), RobustParameters())
    with pytest.raises(ValueError, match="of the reference's shape"):
        measure(reference, reference[:100])


def test_real_presses_reach_the_contact_edge(real_images, overlap):
    folder = real_images / "digit_presses"
    method = RobustMethod(read(str(folder / "reference.jpg")), RobustParameters())
    y, x = np.mgrid[:640, :480]
    overlaps, found = [], []
    for row in csv.DictReader((folder / "contacts.csv").read_text().splitlines()):
        truth = np.hypot(x - float(row["centre_x_px"]), y - float(row["centre_y_px"])) <= float(row["radius_px"])
        contact = method.measure(read(str(folder / row["image"])))
        overlaps.append(overlap(contact.mask, truth))
        found.append(contact.area_px / np.count_nonzero(truth))
    assert np.median(overlaps) >= 0.88
    assert np.percentile(overlaps, 10) >= 0.82
    assert 0.93 <= np.median(found) <= 1.07
    assert np.percentile(found, 10) >= 0.85
    assert np.percentile(found, 90) <= 1.15


def test_real_backgrounds_show_no_contact(real_images, noisy_again):
    for path in [
        *sorted((real_images / "digit_backgrounds").glob("*.jpg")),
        real_images / "digit_presses/reference.jpg",
    ]:
        reference = read(str(path))
        method = RobustMethod(reference, RobustParameters())
        for seed in range(3):
            assert method.measure(noisy_again(reference, seed)).area_px == 0, path.name
