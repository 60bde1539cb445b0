import numpy as np
import pytest

from benchmarks.twin.fit import Press, ball_dent, fit_table, free_of_contact, main, read_presses
from benchmarks.twin.statistics import measure_noise
from station.twin.digit.backgrounds import background
from station.twin.digit.numbers import Fitted
from station.twin.digit.optics import SLOPE_KNOTS, Optics, slope_basis
from station.twin.digit.press import PressOptions, render_press
from station.twin.digit.sensor import Condition, DigitSensor
from station.twin.fruit import Kind, draw_fruit
from station.twin.gel import GRID_MM, GRID_SHAPE, SENSOR_SHAPE, Gel

CALM = PressOptions(noise=0.0, drift=0.0)


@pytest.fixture(scope="module")
def optics():
    fitted = Fitted.load()
    return Optics(fitted.table, fitted.smoothing_mm)


def ramp(slope):
    """A dent that rises along the columns."""
    return np.tile((np.arange(GRID_SHAPE[1]) * GRID_MM * slope).astype(np.float32), (GRID_SHAPE[0], 1))


def test_a_flat_gel_and_the_gentlest_slopes_change_nothing(optics):
    assert not optics.change(np.zeros(GRID_SHAPE, np.float32)).any()
    assert not optics.change(ramp(0.99 * SLOPE_KNOTS[0])).any()


def test_between_two_dents_nothing_changes(optics):
    dent = np.zeros(GRID_SHAPE, np.float32)
    dent[40:60, 40:60] = dent[250:270, 180:200] = 0.3
    change = optics.change(dent)
    assert np.abs(change[90:110, 90:110]).max() > 5
    assert not change[200:400, 150:300].any()


def test_each_side_of_a_ball_takes_its_own_colour():
    press = render_press("rubber_ball", 0, [-1.0, 2.0], CALM)
    change = press.frames[1].astype(int) - press.frames[0]
    above, below, left, right = (
        change[y - 10 : y + 10, x - 10 : x + 10].mean(axis=(0, 1))
        for y, x in ((250, 240), (390, 240), (320, 170), (320, 310))
    )
    # On the fitted unit blue comes from below, red from the right and green from the left, as on the real presses.
    assert below[0] > above[0] + 15
    assert right[2] > left[2] + 15
    assert left[1] > right[1] + 5


def test_the_change_grows_with_the_slope_without_a_step(optics):
    sizes = np.linspace(0.0, 0.5, 101)
    middle = np.array([optics.change(ramp(slope))[320, 240] for slope in sizes])
    assert np.abs(np.diff(middle, axis=0)).max() < 2.5
    assert np.linalg.norm(middle[-1]) > 20


def test_the_basis_is_one_ring_or_two_neighbours():
    slope_x = np.linspace(0, 1.2, 50).astype(np.float32)
    rings = slope_basis(slope_x, np.zeros_like(slope_x))[:, 0]
    assert rings[:, slope_x > SLOPE_KNOTS[1]].sum(axis=0) == pytest.approx(1.0, abs=1e-5)
    assert not rings[:, slope_x <= SLOPE_KNOTS[0]].any()


@pytest.mark.parametrize(("kind", "closing_mm"), [("rubber_ball", 2.0), ("rubber_ball", 4.0), ("test_sphere", 0.6)])
def test_the_change_falls_off_most_steeply_at_the_edge_of_the_truth(kind, closing_mm):
    press = render_press(kind, 0, [-1.0, closing_mm], CALM)
    change = np.linalg.norm(press.frames[1].astype(float) - press.frames[0], axis=2)
    truth = press.true_masks[1] > 0
    y, x = np.indices(SENSOR_SHAPE)
    distance = np.hypot(x - 240, y - 320).astype(int)
    counts = np.bincount(distance.ravel())
    profile = np.convolve(np.bincount(distance.ravel(), change.ravel()) / counts, np.ones(7) / 7, "valid")
    edge_px = np.sqrt(truth.sum() / np.pi)
    window = slice(int(0.6 * edge_px) - 3, int(1.5 * edge_px) - 3)
    steepest_px = np.argmin(np.diff(profile)[window]) + window.start + 3.5
    assert steepest_px == pytest.approx(edge_px, abs=5)


def test_the_same_seed_draws_the_same_frames():
    first, second = (render_press("strawberry", 11, [1.0, 4.0]) for _ in range(2))
    other = render_press("strawberry", 12, [1.0, 4.0])
    for one, same, different in zip(first.frames, second.frames, other.frames, strict=True):
        assert np.array_equal(one, same)
        assert not np.array_equal(one, different)
    assert first.true_areas_mm2 == second.true_areas_mm2


def test_a_press_comes_with_its_truth():
    closings = [-1.0, 1.0, 3.0]
    fruit = draw_fruit("blueberry", 5)
    press = render_press(fruit, 5, closings)
    assert [frame.shape for frame in (*press.references, *press.frames)] == [(640, 480, 3)] * 8
    assert press.widths_mm == pytest.approx([fruit.width_mm - closing for closing in closings])
    assert press.forces_n[0] == press.true_areas_mm2[0] == 0
    assert press.true_areas_mm2 == pytest.approx([0.0266**2 * (mask > 0).sum() for mask in press.true_masks])
    assert press.true_areas_mm2[2] > press.true_areas_mm2[1] > 1


def test_noise_is_new_in_each_frame_and_the_clean_image_is_not():
    noisy, calm = DigitSensor(0), DigitSensor(0, noise=0.0, drift=0.0)
    assert not np.array_equal(noisy.frame(None, 0.0), noisy.frame(None, 0.0))
    assert np.array_equal(calm.frame(None, 0.0), calm.frame(None, 99.0))


def test_pixels_columns_and_rows_have_each_their_fitted_noise():
    sensor, levels = DigitSensor(2, drift=0.0), Fitted.load().noise
    frames = [sensor.frame(None, 0.0) for _ in range(6)]
    found = measure_noise(frames, [np.ones(SENSOR_SHAPE, np.bool_)] * len(frames))
    both = np.sqrt(2)  # two frames make a change
    assert found.pixel == pytest.approx(levels.pixel, rel=0.1)
    assert found.column / both == pytest.approx(levels.column, rel=0.2)
    # The blotchy pixels' own mean over a row is not nothing: alone it makes 0.9 of the rows' level.
    assert 1.2 * levels.row.sum() < found.row.sum() / both < 1.6 * levels.row.sum()


def test_units_differ_in_their_light():
    fitted = Fitted.load()
    images = [background(fitted, unit) for unit in (None, 0, 1, 2)]
    for index, image in enumerate(images):
        assert image.min() >= 0
        assert 20 < image.mean() < 160
        for other in images[:index]:
            assert np.abs(image - other).mean() > 8


@pytest.mark.parametrize(
    "condition",
    [
        Condition(dead_led="red"),
        Condition(torn=True),
        Condition(fog=0.8),
        Condition(dirt=6),
        Condition(light=(1.0, 0.5, 1.0)),
    ],
)
def test_each_ill_shows_in_the_picture(condition):
    sensor = DigitSensor(3, noise=0.0, drift=0.0)
    sound, ill = sensor.frame(None, 0.0).astype(int), sensor.frame(None, 0.0, condition).astype(int)
    assert np.abs(sound - ill).max() > 20
    assert np.array_equal(sensor.frame(None, 0.0), sound)


def test_a_dead_led_darkens_its_colour_alone():
    sensor = DigitSensor(3, noise=0.0, drift=0.0)
    sound, dead = sensor.frame(None, 0.0).astype(float), sensor.frame(None, 0.0, Condition(dead_led="green"))
    assert dead[..., 1].mean() < 0.2 * sound[..., 1].mean()
    assert np.array_equal(dead[..., [0, 2]], sound[..., [0, 2]])


def box(press: Press):
    margin = press.radius_px + 40
    return np.s_[
        int(max(0, press.y_px - margin)) : int(press.y_px + margin),
        int(max(0, press.x_px - margin)) : int(press.x_px + margin),
    ]


def test_presses_held_apart_from_the_fit_are_predicted_within_nine_grey_levels(real_images):
    reference, presses = read_presses(real_images / "digit_presses")
    halves = presses[::2], presses[1::2]
    for fitted_on, tested_on in (halves, halves[::-1]):
        optics = Optics(fit_table(reference, fitted_on), Fitted.load().smoothing_mm)
        errors, untouched = [], []
        for press in tested_on:
            drawn = np.clip(reference + optics.change(ball_dent(press, Gel())), 0, 255)
            errors.append(np.abs(press.image - drawn)[box(press)].mean())
            untouched.append(np.abs(press.image.astype(float) - reference)[box(press)].mean())
        assert np.mean(errors) < 7
        assert np.mean(untouched) > 12


def test_noise_is_as_strong_as_on_the_real_sensor(real_images):
    _, presses = read_presses(real_images / "digit_presses")
    real = measure_noise([press.image for press in presses], [free_of_contact(press) for press in presses])
    sensor, free = DigitSensor(8), np.ones(SENSOR_SHAPE, np.bool_)
    frames = [sensor.frame(None, 10.0 * index) for index in range(80)]
    twin = measure_noise(frames, [free] * len(frames))
    for name in ("pixel", "column", "column_fine", "row", "row_fine"):
        assert getattr(twin, name) == pytest.approx(getattr(real, name), rel=0.25), name
    for name in ("offset_median", "offset_p95"):
        assert getattr(twin, name).mean() == pytest.approx(getattr(real, name).mean(), rel=0.25), name


def test_the_committed_table_is_the_one_that_the_presses_give(real_images):
    reference, presses = read_presses(real_images / "digit_presses")
    assert fit_table(reference, presses) == pytest.approx(Fitted.load().table, abs=0.5)


@pytest.mark.parametrize("content", ["image,radius_px\npress.jpg,4\n", "", None])
def test_the_fit_says_what_is_wrong_with_its_presses(tmp_path, content, capsys):
    if content is not None:
        (tmp_path / "contacts.csv").write_text(content, encoding="utf-8")
    with pytest.raises(Exception, match=r"expected columns image|reference\.jpg|press\.jpg") as caught:
        main([str(tmp_path), str(tmp_path)])
    assert type(caught.value).__name__ == "BadInputError"
    assert main([]) == 2
    assert "usage" in capsys.readouterr().err


def test_a_kind_is_named_by_text_or_enum():
    assert np.array_equal(
        render_press(Kind.RASPBERRY, 1, [2.0]).frames[0], render_press("raspberry", 1, [2.0]).frames[0]
    )
