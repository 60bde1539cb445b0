"""The second press: when it is made, and the verdict of two presses on one fruit together."""

from dataclasses import replace
from pathlib import Path

import pytest

from station.inspection.evidence import AT_MM
from station.inspection.fruit_size import FruitSize
from station.inspection.judge import judge
from station.inspection.press import Measured, Press
from station.inspection.second_press import PRESS_AGAIN_AT, needs_second_press, together
from station.settings.recipe import load_recipe
from station.vocabulary import Flag, Reason

RECIPE = load_recipe(Path(__file__).resolve().parents[2] / "recipes" / "blueberry.yaml")
COUNT_MM = 0.375
CLOSINGS_MM = (0.0, 3 * COUNT_MM, 5 * COUNT_MM, 8 * COUNT_MM)
SOUND_MM2 = (2.0, 10.0, 16.5, 26.0)


def press(areas_mm2=SOUND_MM2, *flags: Flag, onset_mm: float = 14.0, **changes) -> Press:
    """A blueberry's press up to its last threshold; the flags are the last point's."""
    points = tuple(
        Measured(closing_mm, area_mm2, round(area_mm2 * 1400), 0.9)
        for closing_mm, area_mm2 in zip(CLOSINGS_MM, areas_mm2, strict=False)
    )
    points = (*points[:-1], replace(points[-1], flags=frozenset(flags)))
    return replace(Press(onset_mm, 0.1, points, size=FruitSize(14.5)), **changes)


def at_3_mm(measured: Press) -> Measured:
    return measured.points[-1]


def weak(area_mm2: float, confidence: float, *flags: Flag) -> Press:
    """A press whose last point has a weak edge."""
    measured = press((*SOUND_MM2[:-1], area_mm2), Flag.LOW_CONFIDENCE, *flags)
    return replace(measured, points=(*measured.points[:-1], replace(at_3_mm(measured), confidence=confidence)))


def near() -> Press:
    """A press whose area at 3 mm is within the limit, but not surely."""
    limit_mm2 = judge(press(), RECIPE).areas[0].limit_mm2
    assert limit_mm2 is not None
    return press(tuple(0.99 * limit_mm2 / SOUND_MM2[-1] * area_mm2 for area_mm2 in SOUND_MM2))


class TestLooksAgain:
    @pytest.mark.parametrize("flag", [Flag.CUT_BY_BORDER, Flag.LOW_CONFIDENCE, Flag.SATURATED, Flag.UNDECIDED])
    def test_where_the_measurement_did_not_tell_enough(self, flag):
        verdict = judge(press(SOUND_MM2, flag), RECIPE)
        assert verdict.outcome == "NO_RESULT"
        assert needs_second_press(verdict)

    def test_near_the_limit(self):
        verdict = judge(near(), RECIPE)
        assert verdict.reasons == (Reason.NEAR_LIMIT,)
        assert needs_second_press(verdict)

    def test_for_all_such_reasons_at_once(self):
        verdict = judge(press(SOUND_MM2, Flag.SATURATED), RECIPE)
        every = sorted({*PRESS_AGAIN_AT, Reason.EARLY_STOP})
        assert needs_second_press(
            replace(verdict, findings=tuple(replace(verdict.findings[0], reason=reason) for reason in every))
        )

    @pytest.mark.parametrize("outcome", ["PASS", "FAIL"])
    def test_what_is_decided_is_not_pressed_again(self, outcome):
        verdict = judge(press() if outcome == "PASS" else press((2.0, 30.0, 50.0, 80.0)), RECIPE)
        assert verdict.outcome == outcome
        assert not needs_second_press(verdict)

    @pytest.mark.parametrize("fault", [Reason.CAMERA_FAULT, Reason.LATE, Reason.REFERENCE_BAD, Reason.CALLED_OFF])
    def test_a_fault_is_no_reason_to_press_again_also_beside_one(self, fault):
        doubtful = press(SOUND_MM2, Flag.CUT_BY_BORDER, interruptions=(fault,))
        verdict = judge(doubtful, RECIPE)
        assert Reason.CUT_BY_BORDER in verdict.reasons
        assert not needs_second_press(verdict)

    @pytest.mark.parametrize("wrong", [{"size": FruitSize(40.0)}, {"onset_mm": 40.0}, {"onset_mm": None, "points": ()}])
    def test_nor_is_another_fruits_size_a_wrong_width_or_nothing(self, wrong):
        assert not needs_second_press(judge(replace(press(SOUND_MM2, Flag.SATURATED), **wrong), RECIPE))


class TestTogether:
    @pytest.mark.parametrize(
        ("first", "second", "area_mm2"),
        [((30.0,), (34.0,), 32.0), ((30.0, Flag.SATURATED), (34.0,), 34.0), ((30.0,), (34.0, Flag.SATURATED), 30.0)],
    )
    def test_the_mean_of_what_is_trusted(self, first, second, area_mm2):
        one, other = (press((2.0, 10.0, 16.5, area), *flags) for area, *flags in (first, second))
        point = at_3_mm(together([one, other]))
        assert (point.area_mm2, point.area_px, point.flags) == (area_mm2, round(area_mm2 * 1400), frozenset())

    @pytest.mark.parametrize("bound", [Flag.CUT_BY_BORDER, Flag.LOWER_BOUND])
    @pytest.mark.parametrize("first", [True, False])
    def test_a_fruit_is_never_judged_by_less_than_a_lower_bound(self, bound, first):
        for area_mm2, judged_mm2 in ((31.0, 34.0), (39.0, 39.0)):
            cut, whole = press((2.0, 10.0, 16.5, area_mm2), bound), press((2.0, 10.0, 16.5, 34.0))
            point = at_3_mm(together([cut, whole] if first else [whole, cut]))
            assert (point.area_mm2, point.flags) == (judged_mm2, frozenset())

    def test_two_doubtful_ones_stay_doubtful(self):
        one, other = press((30.0,), Flag.SATURATED), press((34.0,), Flag.CUT_BY_BORDER)
        [point] = together([one, other]).points
        assert (point.area_mm2, point.flags) == (34.0, {Flag.CUT_BY_BORDER})

    @pytest.mark.parametrize(
        ("areas_mm2", "confidences", "together_confidence"),
        [
            ((30.0, 30.0), (0.4, 0.4), 0.571),  # twice the odds of 0.4, 2 to 3
            ((30.0, 30.6), (0.48, 0.32), 0.529),  # 2 % apart, so a spread of 1 %
            ((30.0, 36.0), (0.4, 0.4), 0.299),  # a spread of 9 %: they hardly speak of the same
            ((30.0, 30.0), (0.2, 0.2), 0.333),
        ],
    )
    @pytest.mark.parametrize("lost", [(), (Flag.LOWER_BOUND,)])
    def test_two_weak_edges_that_agree_are_trusted_as_far_as_both_say(
        self, areas_mm2, confidences, together_confidence, lost
    ):
        one, other = (
            weak(area_mm2, confidence, *lost) for area_mm2, confidence in zip(areas_mm2, confidences, strict=True)
        )
        for both in (together([one, other]), together([other, one])):
            point = at_3_mm(both)
            assert (point.area_mm2, point.area_px) == (max(areas_mm2), round(max(areas_mm2) * 1400))
            assert point.confidence == pytest.approx(together_confidence, abs=0.001)
            sure = together_confidence >= RECIPE.segmentation.robust.least_confidence
            assert (Reason.LOW_CONFIDENCE in judge(both, RECIPE).reasons) is not sure

    def test_two_weak_edges_of_a_sound_fruit_pass_and_of_a_damaged_one_do_not(self):
        assert judge(together([weak(SOUND_MM2[-1], 0.4)] * 2), RECIPE).outcome == "PASS"
        limit_mm2 = judge(press(), RECIPE).areas[0].limit_mm2
        assert limit_mm2 is not None
        verdict = judge(together([weak(0.9 * limit_mm2, 0.4), weak(1.02 * limit_mm2, 0.4)]), RECIPE)
        assert verdict.outcome == "NO_RESULT", "judged by the larger one"

    @pytest.mark.parametrize("other", [Flag.SATURATED, Flag.REFERENCE_MISMATCH, Flag.CUT_BY_BORDER, Flag.UNDECIDED])
    def test_what_else_speaks_against_an_area_is_not_outweighed(self, other):
        one, spoilt = weak(30.0, 0.4), weak(30.0, 0.4, other)
        assert at_3_mm(together([one, spoilt])).flags == {Flag.LOW_CONFIDENCE, other}
        assert at_3_mm(together([spoilt, one])) == at_3_mm(one)
        nothing = weak(30.0, 0.0)
        assert at_3_mm(together([nothing, one])) == at_3_mm(one)
        sure = weak(30.0, 1.0)  # and yet flagged: no odds can be added to it
        assert at_3_mm(together([sure, sure])) == at_3_mm(sure)

    def test_closings_are_the_same_where_a_gripper_cannot_tell_them_apart(self):
        later = press((2.0, 10.0, 16.5, 30.0))
        rounded = replace(later, points=tuple(replace(p, closing_mm=p.closing_mm + 1e-9) for p in later.points))
        assert at_3_mm(together([press(), rounded])).area_mm2 == 28.0
        a_count_on = replace(later, points=tuple(replace(p, closing_mm=p.closing_mm + COUNT_MM) for p in later.points))
        assert at_3_mm(together([press(), a_count_on])).area_mm2 == 30.0
        onset, just_past = (Press(14.0, 0.4, (Measured(c, 2.0 + c, 1000, 0.9),)) for c in (0.0, AT_MM))
        assert together([just_past, onset]).points[0].area_mm2 == pytest.approx(2.0 + AT_MM / 2)

    def test_the_later_press_says_onset_faults_and_how_far_it_has_come(self):
        later = press(SOUND_MM2[:2], onset_mm=13.6, interruptions=(Reason.CAMERA_FAULT,))
        both = together([press(), later])
        assert (both.onset_mm, both.interruptions, len(both.points)) == (13.6, (Reason.CAMERA_FAULT,), 2)

    def test_one_press_is_itself(self):
        assert together([press()]) == press()

    def test_two_presses_near_the_limit_decide_by_their_mean(self):
        doubtful = near()
        assert judge(together([doubtful, press()]), RECIPE).outcome == "PASS"
        assert judge(together([doubtful, doubtful]), RECIPE).reasons == (Reason.NEAR_LIMIT,)


def test_a_lower_bound_of_both_kinds_counts_with_its_pixels():
    bound = press((2.0, 10.0, 16.5, 30.0), Flag.CUT_BY_BORDER, Flag.LOWER_BOUND)
    last = together((bound, press())).points[-1]
    assert (last.area_mm2, last.area_px, last.flags) == (30.0, 42_000, frozenset())


def with_last(measured: Press, **changes) -> Press:
    return replace(measured, points=(*measured.points[:-1], replace(at_3_mm(measured), **changes)))


@pytest.mark.parametrize(
    "changes",
    [
        {"confidence": None},
        {"area_mm2": 0.0, "area_px": 0},
        {"flags": frozenset({Flag.LOWER_BOUND})},
    ],
    ids=["of no confidence", "of no area", "whose edge was lost"],
)
@pytest.mark.parametrize("first", [True, False])
def test_an_edge_beside_one_gains_no_confidence_from_it(changes, first):
    ordinary, other = weak(26.0, 0.45), with_last(weak(26.0, 0.45), **changes)
    presses = (other, ordinary) if first else (ordinary, other)
    assert at_3_mm(together(presses)) == at_3_mm(presses[-1])
