"""The robust method on golden spheres and on real presses."""

import csv

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from station.settings.segmentation import RobustParameters
from station.studies.cohort import member
from station.twin.contact import FruitOnGel, Pose
from station.twin.digit.press import PressOptions, render_press
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import draw_fruit
from station.twin.gel import MM_PER_PX, Gel
from station.twin.squeeze import Squeeze
from station.vision.contact import Flag
from station.vision.robust import RobustMethod
from station.vision.step import mean_image

FEW = settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def read(path):
    image = cv2.imread(path)
    assert image is not None
    return np.asarray(image, np.uint8)


def measure(reference, image, **parameters):
    return RobustMethod([reference], RobustParameters(**parameters)).measure(image)


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


@pytest.mark.parametrize(("x_px", "y_px"), [(0, 320), (30, 320), (450, 320), (240, 40)])
def test_of_a_large_contact_that_the_border_cuts_the_visible_part_is_measured(x_px, y_px):
    press = render_press("blueberry", 2602, (5.0, 7.0), PressOptions(pose=Pose(x_px, y_px)))
    method = RobustMethod(press.references, RobustParameters())
    for frame, truth in zip(press.frames, press.true_masks, strict=True):
        contact = method.measure(frame)
        assert Flag.CUT_BY_BORDER in contact.flags
        assert contact.area_px == pytest.approx(np.count_nonzero(truth), rel=0.12)


def test_a_contact_as_wide_as_the_image_is_not_mirrored_at_its_upper_border():
    press = render_press("blueberry", 50000, (6.0, 8.0, 10.0), PressOptions(pose=Pose(225, 295), unit=50000))
    contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[-1])
    assert contact.area_px == pytest.approx(np.count_nonzero(press.true_masks[-1]), rel=0.1)


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


def test_a_large_soft_contact_that_bends_the_gel_little_is_whole():
    press = render_press("rubber_ball", 0, (7.0, 8.0))
    method = RobustMethod(press.references, RobustParameters())
    for frame, truth in zip(press.frames, press.true_masks, strict=True):
        contact = method.measure(frame)
        assert contact.gate is not None
        assert contact.gate < 2
        assert contact.area_px == pytest.approx(np.count_nonzero(truth), rel=0.15)


@pytest.mark.parametrize(("kind", "closing_mm", "rel"), [("strawberry", 3.0, 0.2), ("raspberry", 4.0, 0.15)])
def test_a_bruised_fruit_over_half_of_the_field_is_whole(kind, closing_mm, rel):
    ratios = []
    for seed in (900, 901, 902):
        press = render_press(draw_fruit(kind, seed, bruised=True), seed, (closing_mm,))
        truth = np.count_nonzero(press.true_masks[0])
        assert truth > 0.45 * press.true_masks[0].size
        ratios.append(RobustMethod(press.references, RobustParameters()).measure(press.frames[0]).area_px / truth)
    assert np.median(ratios) == pytest.approx(1, abs=rel)


def test_a_contact_that_fills_the_field_is_a_lower_bound_and_not_sure():
    press = render_press(draw_fruit("strawberry", 900, bruised=True), 900, (12.0,))
    assert press.true_masks[0].mean() > 0.99 * press.true_masks[0].max()
    contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[0])
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
    press = member(kind, 2025, number).press()
    method = RobustMethod(press.references, RobustParameters())
    truths = [np.count_nonzero(mask) for mask in press.true_masks]
    deep = [place for place, truth in enumerate(truths) if truth * MM_PER_PX**2 > from_mm2]
    assert len(deep) >= 3
    ratios = [method.measure(press.frames[place]).area_px / truths[place] for place in deep]
    assert ratios == pytest.approx([1.0] * len(deep), abs=rel)


@pytest.mark.parametrize(("number", "image"), [(91, 11), (148, 13), (262, 14)])
def test_a_contact_of_which_the_border_cuts_only_the_skirt_is_not_mirrored(number, image):
    press = member("blueberry", 1, number).press()
    truth = np.count_nonzero(press.true_masks[image])
    contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[image])
    assert contact.area_px == pytest.approx(truth, rel=0.1)


def untouched(unit, drift, after_s, dead_led=None):
    """A method prepared for a unit of the twin, and its last mean image of those times, with nothing touching."""
    condition = Condition(dead_led=dead_led)
    sensor = DigitSensor(unit, unit, drift=drift)
    references = [sensor.frame(None, frame / 30, condition) for frame in range(5)]
    means = [
        mean_image([sensor.frame(None, began_s + frame / 30, condition) for frame in range(3)]) for began_s in after_s
    ]
    return RobustMethod(references, RobustParameters()), means[-1]


def test_drift_in_a_corner_without_light_that_opens_the_gate_a_little_is_not_sure():
    method, image = untouched(30017, 1.0, (1.0, 3.0))
    contact = method.measure(image)
    assert contact.gate is not None
    assert 1 < contact.gate < 2
    assert Flag.CUT_BY_BORDER in contact.flags
    assert Flag.LOW_CONFIDENCE in contact.flags


@pytest.mark.parametrize(
    ("unit", "drift", "dead_led", "after_s"),
    [
        (31009, 2.0, None, (1.0, 3.0, 5.0)),
        (31021, 2.0, None, (1.0, 3.0, 5.0)),
        (30020, 1.0, "red", (1.0, 3.0, 5.0)),
    ],
)
def test_drift_that_opens_the_gate_is_no_contact_where_the_gel_shows_no_slopes(unit, drift, dead_led, after_s):
    method, image = untouched(unit, drift, after_s, dead_led)
    contact = method.measure(image)
    assert contact.gate is not None
    assert contact.gate > 1
    assert contact.area_px == 0
    assert Flag.UNDECIDED in contact.flags


@pytest.mark.parametrize(("kind", "seed"), [("blueberry", 502), ("raspberry", 501), ("rubber_ball", 507)])
def test_a_touch_lighter_than_the_gate_is_found_and_not_sure(kind, seed):
    fruit, gel = draw_fruit(kind, seed), Gel()
    on_gel, squeeze = FruitOnGel(fruit, Pose(), gel), Squeeze(fruit, gel)
    closings = np.geomspace(0.002, 1.0, 40)
    seen = min((on_gel.pressed(squeeze.at(float(one))) for one in closings), key=lambda one: abs(one.true_area_mm2 - 1))
    sensor = DigitSensor(seed)
    references = [sensor.frame(None, frame / 30) for frame in range(5)]
    image = mean_image([sensor.frame(seen.dent, 1.0 + frame / 30) for frame in range(3)])
    contact = RobustMethod(references, RobustParameters()).measure(image)
    assert contact.gate is not None
    assert contact.gate < 1
    assert 0.5 < contact.area_px / seen.true_area_px < 2
    assert contact.found
    assert not contact.is_firm
    assert Flag.LOW_CONFIDENCE in contact.flags


def test_an_area_that_only_the_slopes_support_is_not_judged():
    options = PressOptions(pose=Pose(257, 647), unit=20)
    press = render_press("blueberry", 60013, (0.8, 1.2, 2.5, 5.0, 7.0), options)
    contact = RobustMethod(press.references, RobustParameters()).measure(press.frames[-1])
    assert 0 < contact.area_px < 0.75 * np.count_nonzero(press.true_masks[-1])
    assert {Flag.LOW_CONFIDENCE, Flag.CUT_BY_BORDER} <= contact.flags
    assert contact.gate is not None
    assert contact.gate > 1
    assert not contact.is_firm


def test_a_crown_is_not_taken_for_its_blueberry():
    press = render_press(draw_fruit("blueberry", 7002, bruised=True), 7002, (4.0, 6.5))
    method = RobustMethod(press.references, RobustParameters())
    for frame, truth in zip(press.frames, press.true_masks, strict=True):
        assert method.measure(frame).area_px == pytest.approx(np.count_nonzero(truth), rel=0.15)


def test_confidence_falls_with_the_contrast(sphere_press):
    given = [sphere_press(levels=levels) for levels in (60, 12, 4)]
    confidences = [measure(press.reference, press.image).confidence or 0.0 for press in given]
    assert confidences == sorted(confidences, reverse=True)
    assert confidences[0] > confidences[-1] + 0.05


def test_several_references_are_their_median(sphere_press, overlap):
    press = sphere_press()
    references = [sphere_press(seed=seed).reference for seed in range(3)]
    spoiled = np.zeros_like(press.reference)
    contact = RobustMethod([*references, spoiled], RobustParameters()).measure(press.image)
    assert overlap(contact.mask, press.truth) > 0.85


def test_every_stage_hands_on_a_picture_of_the_image_size(sphere_press):
    press = sphere_press()
    method = RobustMethod([press.reference], RobustParameters())
    seen = {}
    method.measure(press.image, seen.__setitem__)
    assert tuple(seen) == method.stages
    assert all(picture.shape[:2] == (640, 480) and picture.dtype == np.uint8 for picture in seen.values())


def test_what_does_not_fit_the_reference_is_refused(sphere_press):
    reference = sphere_press().reference
    with pytest.raises(ValueError, match="no reference"):
        RobustMethod([], RobustParameters())
    with pytest.raises(ValueError, match="one size"):
        RobustMethod([reference, reference[:100]], RobustParameters())
    with pytest.raises(ValueError, match="of the reference's shape"):
        measure(reference, reference[:100])


def test_real_presses_reach_the_contact_edge(real_images, overlap):
    folder = real_images / "digit_presses"
    method = RobustMethod([read(str(folder / "reference.jpg"))], RobustParameters())
    y, x = np.mgrid[:640, :480]
    overlaps, ratios = [], []
    for row in csv.DictReader((folder / "contacts.csv").read_text().splitlines()):
        truth = np.hypot(x - float(row["centre_x_px"]), y - float(row["centre_y_px"])) <= float(row["radius_px"])
        contact = method.measure(read(str(folder / row["image"])))
        overlaps.append(overlap(contact.mask, truth))
        ratios.append(contact.area_px / np.count_nonzero(truth))
    assert np.median(overlaps) >= 0.88
    assert np.percentile(overlaps, 10) >= 0.82
    assert 0.93 <= np.median(ratios) <= 1.07
    assert np.percentile(ratios, 10) >= 0.85
    assert np.percentile(ratios, 90) <= 1.15


def test_real_backgrounds_show_no_contact(real_images, noisy_again):
    for path in [
        *sorted((real_images / "digit_backgrounds").glob("*.jpg")),
        real_images / "digit_presses/reference.jpg",
    ]:
        reference = read(str(path))
        method = RobustMethod([reference], RobustParameters())
        for seed in range(3):
            assert method.measure(noisy_again(reference, seed)).area_px == 0, path.name
