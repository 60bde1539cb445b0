"""Calibration: the figures that it finds, and the runs that it refuses."""

import asyncio
import html
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from station.calibration.calibration_procedure import CalibrationProcedure
from station.calibration.errors import RefusedError
from station.calibration.figures import noise, scale_of
from station.calibration.gate import gated
from station.calibration.model import PlacePoint, Refusal
from station.calibration.report import refusal_files
from station.calibration.rig import Unit
from station.errors import BadInputError
from station.press.reference import take_reference
from station.settings.calibration import CalibrationSettings
from station.settings.recipe import find_recipe
from station.settings.segmentation import Segmentation
from station.twin.digit.sensor import Condition
from station.twin.fruit import Kind
from station.vision.contact import Contact

UNIT = Unit("T0001", "drawn DIGIT", simulated=True)


def test_the_scale_of_a_unit_is_found_where_the_ball_is_moved_a_known_way(draft):
    calibration = draft.calibration
    assert calibration.scale_measured
    assert abs(calibration.mm_per_px / 0.0285 - 1) < calibration.scale_uncertainty < 0.04
    assert abs(0.0266 / 0.0285 - 1) > calibration.scale_uncertainty  # the usual scale is not the unit's


def test_onset_zero_noise_light_and_curve_are_found(draft):
    calibration = draft.calibration
    assert 41.0 < calibration.onset_mm <= 42.0
    assert calibration.zero_mm == pytest.approx(calibration.onset_mm - 42.0)
    assert all(0.5 < level < 5 for level in calibration.noise.pixel_levels)
    assert calibration.noise.gate < 1.0
    assert len(calibration.field.light_levels) == len(calibration.field.noise_levels) == 16 * 12
    assert all(check.passed for check in calibration.checks)
    widths = [point.width_mm for point in calibration.curve]
    assert len(widths) == 14
    assert (widths[0], widths[-1]) == pytest.approx((46, 33), abs=0.4)
    whole = [point for point in calibration.curve if calibration.onset_mm - 6 < point.width_mm <= calibration.onset_mm]
    assert all(after.area_px > before.area_px for before, after in pairwise(whole))


def test_one_place_gives_the_usual_scale_and_says_so(drawn_ball, calibrate_drawn):
    reported = []
    ball = drawn_ball(2)
    calibration = calibrate_drawn(ball, progress=reported).calibration
    assert (calibration.mm_per_px, calibration.scale_measured) == (0.0266, False)
    assert calibration.scale_uncertainty == 0.15
    assert ball.released == 1
    steps = [progress for progress in reported if progress.of == 14]
    assert [progress.number for progress in steps] == list(range(1, 15))


@pytest.mark.parametrize(
    ("ball", "reason"),
    [
        ({"holder_mm": 24.0}, "touches the gel at the start"),
        ({"holder_mm": 14.5}, "contact begins at 3"),
        ({"holder_mm": 2.0}, "nothing touched the gel"),
        ({"kind": Kind.STRAWBERRY, "holder_mm": 6.0}, "rubber ball in.* and nothing else"),
        ({"condition": Condition(torn=True)}, "torn or cut"),
        ({"condition": Condition(dirt=6)}, "look like dirt"),
        ({"condition": Condition(dead_led="green")}, "LED is dead"),
    ],
)
def test_what_is_no_calibration_is_refused_with_its_reason(drawn_ball, calibrate_drawn, ball, reason):
    bench = drawn_ball(1, **ball)
    with pytest.raises(RefusedError, match=reason) as refused:
        calibrate_drawn(bench)
    assert bench.released == 1
    assert "no calibration is stored" in str(refused.value)


def test_a_refusal_keeps_every_picture_and_check_and_is_never_used(drawn_ball, store):
    procedure = CalibrationProcedure(
        drawn_ball(1, kind=Kind.STRAWBERRY, holder_mm=6.0),
        UNIT,
        find_recipe("rubber_ball"),
        CalibrationSettings(),
        [],
        "anna",
        "0.1",
        [].append,
    )
    with pytest.raises(RefusedError) as refused:
        asyncio.run(procedure.run())
    evidence = procedure.evidence
    refusal = Refusal(
        id="20260101T000000Z",
        serial=UNIT.serial,
        unit=UNIT.name,
        operator="anna",
        reasons=refused.value.reasons,
        checks=evidence.checks,
        curve=tuple(step.point for step in evidence.steps),
    )
    folder = store.add_refusal(refusal, refusal_files(refusal, evidence))
    assert len(list(folder.glob("press_*.png"))) == len(evidence.steps) == 14
    assert (folder / "reference.png").exists()
    page = (folder / "report.html").read_text()
    assert all(html.escape(str(reason)).replace("&#x27;", "&#39;") in page for reason in refused.value.reasons)
    assert any(not check.passed for check in refusal.checks)
    assert Refusal.model_validate_json((folder / "refusal.json").read_bytes()) == refusal
    assert store.current(UNIT.serial) is None


def test_an_area_that_falls_is_refused(drawn_ball, calibrate_drawn):
    class Slipping(drawn_ball):
        async def close_to(self, width_mm):
            return replace(
                await super().close_to(width_mm + (3.0 if abs(width_mm - 38) < 0.5 else 0.0)), width_mm=width_mm
            )

    with pytest.raises(RefusedError, match=r"rising: from 39\.0 to 38\.0 mm the area goes from"):
        calibrate_drawn(Slipping(1))


def test_a_place_that_is_not_where_it_is_said_to_be_is_refused(drawn_ball, calibrate_drawn):
    class Careless(drawn_ball):
        async def lay(self, place):
            await super().lay(place._replace(x_mm=place.x_mm / 2))

    with pytest.raises(RefusedError, match=r"scale: 0\.0"):
        calibrate_drawn(Careless(1), (3.0, 0.0))
    with pytest.raises(RefusedError, match="no whole contact is seen"):
        calibrate_drawn(drawn_ball(1), (6.0, 0.0))


def test_places_in_one_spot_are_refused_before_anything_moves(drawn_ball, calibrate_drawn):
    with pytest.raises(BadInputError, match="at least 2 mm apart"):
        calibrate_drawn(drawn_ball(1), (0.5, 0.5))


def test_called_off_in_the_middle_the_jaws_open(drawn_ball):
    async def scenario():
        ball, pressing = drawn_ball(1), asyncio.Event()

        def report(progress):
            if progress.number == 3:
                pressing.set()

        recipe = find_recipe("rubber_ball")
        procedure = CalibrationProcedure(ball, UNIT, recipe, CalibrationSettings(), [], "anna", "0.1", report)
        running = asyncio.create_task(procedure.run())
        await pressing.wait()
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running
        return ball

    assert asyncio.run(scenario()).released == 1


def place(x_mm, y_mm, x_px, y_px):
    return PlacePoint(x_mm=x_mm, y_mm=y_mm, width_mm=40, centroid_x_px=x_px, centroid_y_px=y_px, area_px=9)


def test_the_scale_does_not_mind_how_the_axes_lie_and_doubts_places_that_disagree():
    turned = [place(0, 0, 100, 100), place(3, 0, 100, 200), place(0, 4, 233.333, 100)]
    scale = scale_of(turned, 0.05)
    assert scale.mm_per_px == pytest.approx(0.03, rel=1e-4)
    assert 0.01 < scale.uncertainty < 0.03
    crooked = [place(0, 0, 100, 100), place(3, 0, 100, 200), place(0, 4, 260, 100)]
    assert scale_of(crooked, 0.05).uncertainty > 2 * scale.uncertainty


def test_a_noisy_unit_gets_a_higher_gate_and_a_quiet_one_keeps_the_recipes(drawn_ball):
    frames = asyncio.run(take_reference(drawn_ball(1), 4)).images
    empty = Contact(np.zeros((2, 2), np.uint8), 0, None, frozenset(), gate=1.0, drift_levels=2.0)
    found = noise(frames, [empty])
    assert found.gate_factor == pytest.approx(1.25)
    raised = gated(Segmentation(), found.gate_factor).robust
    assert (raised.gate_ratio, raised.least_bend) == pytest.approx((3.75, 0.1875))
    assert gated(Segmentation(), 1.0) == Segmentation()
