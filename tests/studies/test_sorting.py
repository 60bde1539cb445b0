"""The sorting run: what it draws, presses, decides closing by closing, keeps and counts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sorting import presses, tables
from benchmarks.sorting.cycle import (
    Found,
    Inspected,
    Practice,
    Unmeasured,
    as_stopped,
    inspect,
    move_mm,
    seconds,
    sized_by,
)
from benchmarks.sorting.presses import Closing, PressCache, Pressed, Step
from benchmarks.sorting.specimens import KINDS, ON_UNITS, UNITS, Task, draw
from station.settings.gripper import GripperCalibration
from station.settings.recipe import find_recipe
from station.twin.fruit import Kind
from station.vision.scale import TYPICAL_MM_PER_PX
from station.vocabulary import Reason

ROOT = Path(__file__).resolve().parents[2]
BLUEBERRY = Task(Kind.BLUEBERRY, "sound", "tuning", 0)
CLOSINGS_MM = (0.0, 1.12, 1.87, 3.0, 4.12)
SOUND_MM2 = (3.0, 19.0, 27.0, 37.0, 47.0)


def pressed(areas_mm2=SOUND_MM2, offset_px=(0.0, 0.0), flags=(), confidence=0.9) -> Pressed:
    """A closing on the blueberry above, in its own unit's pixels; flags and confidence are the third step's."""
    scale = draw(BLUEBERRY).calibrated_mm_per_px
    steps = [
        Step(closing_mm, round(area_mm2 / scale**2), 0.9, (), offset_px, number / 2)
        for number, (closing_mm, area_mm2) in enumerate(zip(CLOSINGS_MM, areas_mm2, strict=True))
    ]
    steps[3] = steps[3]._replace(flags=flags, confidence=confidence)
    return Pressed(15.9, 0.1, tuple(steps))


class Presses:
    """Closings returned in turn, and which were requested."""

    def __init__(self, *answers: Pressed | None) -> None:
        self.answers, self.requested = list(answers), []

    def __call__(self, closing: Closing) -> Pressed | None:
        self.requested.append(closing)
        return self.answers.pop(0)


@pytest.fixture
def recipe():
    """The shipped recipe, but centred from 0.4 mm on."""
    shipped = find_recipe("blueberry")
    return shipped.model_copy(update={"press": shipped.press.model_copy(update={"centre_from_mm": 0.4})})


class TestSpecimens:
    def test_a_fruit_is_drawn_again_alike_and_no_two_sets_share_one(self):
        assert draw(BLUEBERRY) == draw(BLUEBERRY)
        others = [BLUEBERRY._replace(seeds="judging"), BLUEBERRY._replace(number=1), BLUEBERRY._replace(group="mild")]
        assert len({draw(task).fruit.length_mm for task in (BLUEBERRY, *others)}) == 4

    def test_units_lie_in_their_range_and_graders_and_calibrations_err_as_they_say(self):
        drawn = [draw(BLUEBERRY._replace(number=number)) for number in range(300)]
        assert all(0.0255 <= one.mm_per_px <= 0.0291 for one in drawn)
        graded = np.array([one.graded_mm - one.fruit.length_mm for one in drawn])
        assert 0.9 < np.abs(graded).max() <= 1.0
        errors = np.array([one.calibrated_mm_per_px / one.mm_per_px - 1 for one in drawn])
        assert errors.std() == pytest.approx(0.011, rel=0.15)

    def test_a_few_units_over_the_whole_range_press_their_set_in_turn(self):
        drawn = [draw(Task(Kind.RASPBERRY, "mild", ON_UNITS, number)) for number in range(UNITS + 1)]
        scales = [one.mm_per_px for one in drawn[:UNITS]]
        assert (scales[0], scales[-1]) == pytest.approx((0.0255, 0.0291))
        assert np.diff(scales) == pytest.approx((0.0291 - 0.0255) / (UNITS - 1))
        assert (drawn[UNITS].unit, drawn[UNITS].mm_per_px) == (drawn[0].unit, drawn[0].mm_per_px)
        assert drawn[UNITS].fruit != drawn[0].fruit
        assert len({one.unit for one in drawn}) == UNITS

    @pytest.mark.parametrize("kind", KINDS)
    def test_the_group_says_how_it_is_damaged(self, kind):
        task = Task(kind, "sound", "tuning", 3)
        assert not draw(task).fruit.bruised
        assert draw(task._replace(group="mild")).fruit.damage.softening == 0.6


class TestPressing:
    def test_a_fruit_that_is_measured_while_the_jaws_close_has_images_on_the_way_and_steps_after_it(self, tmp_path):
        blueberry = (ROOT / "recipes" / "blueberry.yaml").read_text()
        own = blueberry.replace("\nsteps:", "\nsteps:\n  measured: while_closing")
        (tmp_path / "blueberry.yaml").write_text(own)
        closing = Closing(BLUEBERRY, 1, (0.0, 0.0))
        _, found = presses.press(closing, tmp_path)
        way = [step.closing_mm for step in found.steps if step.on_the_way]
        count_mm = GripperCalibration().mm_per_count
        assert [step.closing_mm for step in found.steps if not step.on_the_way] == pytest.approx(
            [0.0, *(round(steps / count_mm) * count_mm for steps in (3, 4, 5))]
        )
        assert all(0 < closing_mm < 3 for closing_mm in way)
        assert np.diff(way).mean() == pytest.approx(find_recipe("blueberry").gripper.speed_mm_s / 30, abs=0.2)
        assert not any(step.on_the_way for step in presses.press(closing)[1].steps)

    def test_the_arm_brings_the_contact_to_the_middle(self, recipe):
        """A closing off the middle, its move, and the next closing: nearer than a move is made for."""
        task = next(
            task for number in range(50) if abs(draw(task := BLUEBERRY._replace(number=number)).pose.x_px - 240) > 40
        )
        _, first = presses.press(Closing(task, 0, (0.0, 0.0)))
        move = move_mm(first.steps[0], recipe, (0.0, 0.0))
        assert move is not None
        _, second = presses.press(Closing(task, 1, move))
        for step in second.steps[:4]:
            assert step.offset_px is not None
            assert np.hypot(*step.offset_px) * TYPICAL_MM_PER_PX < 0.4
        # Later closings are not taken as far as the early stops of the first.
        assert first.steps[-1].closing_mm > second.steps[-1].closing_mm > 4

    def test_an_arm_moves_by_its_own_steps_within_its_bounds(self, recipe):
        step = Step(0.0, 500, 0.9, (), None, 0.1)
        assert move_mm(step, recipe, (0.0, 0.0)) is None
        assert move_mm(step._replace(offset_px=(10.0, 0.0)), recipe, (0.0, 0.0)) is None
        assert move_mm(step._replace(offset_px=(30.0, -20.0)), recipe, (0.0, 0.0)) == (-0.8, 0.55)
        assert move_mm(step._replace(offset_px=(120.0, 0.0)), recipe, (0.0, 0.0)) is None


class TestDeciding:
    def test_one_closing_decides_a_sound_fruit_in_the_middle(self, recipe):
        presses = Presses(pressed())
        one = inspect(BLUEBERRY, recipe, Practice(), presses)
        assert (one.outcome, one.closings) == ("PASS", 1)
        assert presses.requested == [Closing(BLUEBERRY, 0, (0.0, 0.0))]
        assert one.most_force_n == (one.steps) / 2

    def test_a_contact_off_the_middle_is_centred_before_it_is_judged(self, recipe):
        presses = Presses(pressed((9.0,) * 5, offset_px=(40.0, 0.0)), pressed())
        one = inspect(BLUEBERRY, recipe, Practice(), presses)
        assert (one.outcome, one.closings) == ("PASS", 2)
        assert presses.requested[1] == Closing(BLUEBERRY, 1, (-1.05, 0.0))
        assert (
            inspect(BLUEBERRY, recipe, Practice(centring=False), Presses(pressed(offset_px=(40.0, 0.0)))).closings == 1
        )

    def test_an_inconclusive_fruit_is_pressed_once_more(self, recipe):
        doubtful, weak = (pressed(flags=("low_confidence",), confidence=confidence) for confidence in (0.2, 0.4))
        assert inspect(BLUEBERRY, recipe, Practice(), Presses(doubtful, pressed())).outcome == "PASS"
        assert inspect(BLUEBERRY, recipe, Practice(second_press=False), Presses(doubtful)).outcome == "NO_RESULT"
        twice = inspect(BLUEBERRY, recipe, Practice(), Presses(doubtful, doubtful))
        assert (twice.outcome, twice.reasons, twice.closings) == ("NO_RESULT", (Reason.LOW_CONFIDENCE,), 2)
        assert inspect(BLUEBERRY, recipe, Practice(), Presses(weak, weak)).outcome == "PASS", "both together"

    def test_the_image_where_the_fingers_come_to_rest_is_taken_before_one_on_the_way_ends_the_closing(self, recipe):
        def points(areas_mm2, on_the_way):
            steps = pressed(areas_mm2).steps
            steps = (*(step._replace(on_the_way=True) for step in steps[:on_the_way]), *steps[on_the_way:])
            return as_stopped(Pressed(15.9, 0.1, steps), draw(BLUEBERRY), recipe, Practice(), ())[1]

        too_large = (*SOUND_MM2[:2], 60.0, 62.0, 64.0)
        assert [points(too_large, number) for number in (0, 2, 3, 4)] == [3, 3, 4, 4]

    def test_steps_take_their_motion_and_those_at_rest_their_frames_and_the_pause(self, recipe):
        steps = pressed().steps
        way_s = steps[-1].closing_mm / recipe.gripper.speed_mm_s
        frames_s = recipe.imaging.frames_per_step / 30
        assert seconds((), recipe) == seconds(steps[:1], recipe) == 0.0
        assert seconds(steps, recipe) == pytest.approx(way_s + 4 * (frames_s + recipe.imaging.settle_s))
        on_the_way = [steps[0], *(step._replace(on_the_way=True) for step in steps[1:3]), *steps[3:]]
        assert seconds(on_the_way, recipe) == pytest.approx(way_s + 2 * frames_s + recipe.imaging.settle_s)

    def test_a_damaged_fruit_is_not(self, recipe):
        presses = Presses(pressed((9.0, 40.0, 60.0, 80.0, 100.0)))
        assert inspect(BLUEBERRY, recipe, Practice(), presses).outcome == "FAIL"

    def test_what_is_not_measured_is_asked_for(self, recipe):
        with pytest.raises(Unmeasured) as missing:
            inspect(BLUEBERRY, recipe, Practice(), Presses(pressed(offset_px=(40.0, 0.0)), None))
        assert missing.value.closing == Closing(BLUEBERRY, 1, (-1.05, 0.0))

    @pytest.mark.parametrize(
        ("size", "given"), [("length", (True, False)), ("class", (False, True)), ("none", (False,) * 2)]
    )
    def test_the_judge_gets_the_size_that_the_grader_gives(self, recipe, size, given):
        practice = Practice(size=size)
        by = sized_by(practice, recipe)
        press, _ = as_stopped(pressed(), draw(BLUEBERRY), by, practice, ())
        assert (press.size.length_mm is not None, press.size.size_class is not None) == given
        assert by.damage.size is not None
        assert by.damage.size.judged_by == ("class" if size == "class" else "length")

    def test_the_usual_scale_stands_in_where_a_unit_was_never_calibrated(self, recipe):
        one = replace(draw(BLUEBERRY), mm_per_px=0.029, calibrated_mm_per_px=0.029)
        areas = [
            as_stopped(pressed(), one, recipe, Practice(calibrated=calibrated), ())[0].points[2].area_mm2
            for calibrated in (True, False)
        ]
        assert areas[1] == pytest.approx(areas[0] * (0.0266 / 0.029) ** 2)

    def test_a_unit_that_was_calibrated_has_the_scale_and_the_uncertainty_that_were_found(self, recipe):
        one = replace(draw(BLUEBERRY), unit=7, calibrated_mm_per_px=0.027)
        found = Practice(calibrations=(Found(6, 0.025, 0.01), Found(7, 0.03, 0.02)))
        own, drawn = (as_stopped(pressed(), one, recipe, each, ())[0] for each in (found, Practice()))
        assert own.points[2].area_mm2 == pytest.approx(drawn.points[2].area_mm2 * (0.03 / 0.027) ** 2)
        assert (own.scale_uncertainty, drawn.scale_uncertainty) == (0.02, 0.011)


class TestCache:
    def test_closings_are_measured_once_and_kept(self, tmp_path, monkeypatch, capsys):
        made = []

        def press(closing: Closing, recipes: Path | None) -> tuple[Closing, Pressed]:
            assert recipes is None
            made.append(closing)
            return closing, pressed()

        monkeypatch.setattr(presses, "press", press)
        wanted = [Closing(BLUEBERRY._replace(number=number), 0, (0.0, 0.0)) for number in range(3)]
        PressCache(tmp_path, 1).measure([*wanted, wanted[0]])
        again = PressCache(tmp_path, 1)
        again.measure(wanted)
        assert made == wanted
        assert again.get(wanted[2]) == pressed()
        assert "3 of 3" in capsys.readouterr().err
        blueberry = (ROOT / "recipes" / "blueberry.yaml").read_text()
        (tmp_path / "own").mkdir()
        (tmp_path / "own" / "blueberry.yaml").write_text(blueberry.replace("frames_per_step: 3", "frames_per_step: 4"))
        assert PressCache(tmp_path, 1, tmp_path / "own").get(wanted[0]) is None
        monkeypatch.setattr(presses, "made_by", lambda _recipe: "other code")
        assert PressCache(tmp_path, 1).get(wanted[0]) is None


class TestTables:
    def test_wilsons_interval_has_its_known_values(self):
        assert tables.wilson(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)
        assert tables.wilson(5, 10) == pytest.approx((0.2366, 0.7634), abs=1e-4)

    def test_both_errors_are_counted(self):
        def one(group, outcome):
            return Inspected(BLUEBERRY._replace(group=group), outcome, (), 1, 3, 1.0, 1.0)

        inspected = [one("sound", "PASS"), one("sound", "NO_RESULT"), one("severe", "FAIL"), one("mild", "PASS")]
        row = tables.errors(inspected)[2]
        assert row.startswith("| blueberry | 1 of 2, 50.0 %")
        assert "| 0 of 1, 0.0 %" in row
        assert "| 1 of 1, 100.0 %" in row
        assert row.endswith("| not run |")
