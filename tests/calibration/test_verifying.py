"""The shift's check: what passes, and each ill of the gel by its name and with a picture."""

import asyncio
import html

import cv2
import numpy as np
import pytest

from station.calibration.gel import GelFault, examine
from station.calibration.report import verification_files
from station.calibration.verification_procedure import VerificationProcedure
from station.press.reference import take_reference
from station.settings.calibration import CalibrationSettings
from station.settings.recipe import find_recipe
from station.twin.digit.sensor import Condition
from station.vision.median import median_image


def verified(ball, draft, report=lambda _progress: None):
    recipe, settings = find_recipe("rubber_ball"), CalibrationSettings()
    pictures = draft.reference, [step.image for step in draft.steps]
    procedure = VerificationProcedure(ball, recipe, settings, draft.calibration, *pictures, "anna", report)
    return asyncio.run(procedure.run())


def test_the_same_ball_on_the_same_sensor_passes(drawn_ball, draft):
    ball = drawn_ball(1, mm_per_px=0.0285)
    result = verified(ball, draft)
    verification = result.verification
    assert verification.passed, [check for check in verification.checks if not check.passed]
    assert verification.area_ratio == pytest.approx(1.0, abs=0.05)
    assert verification.calibration == draft.calibration.id
    assert len(verification.checks) == 4 + len(GelFault)
    assert len(verification.curve) < len(draft.calibration.curve)
    assert ball.released == 1


@pytest.mark.parametrize(
    ("condition", "ill"),
    [
        (Condition(torn=True), GelFault.TEAR),
        (Condition(dirt=3), GelFault.DIRT),
        (Condition(dead_led="red"), GelFault.LED),
        (Condition(light=(1.0, 0.6, 1.0)), GelFault.LED),
        (Condition(fog=0.8), GelFault.FOG),
        (Condition(wear=0.8), GelFault.WEAR),
    ],
)
def test_each_ill_of_the_gel_is_named_and_shown(drawn_ball, draft, condition, ill):
    result = verified(drawn_ball(1, mm_per_px=0.0285, condition=condition), draft)
    assert not result.verification.passed
    health = {check.name: check for check in result.verification.checks if check.name in list(GelFault)}
    assert [name for name, check in health.items() if not check.passed] == [ill]
    picture = health[ill].picture
    assert picture is not None
    files = verification_files(result, draft.calibration)
    shown = cv2.imdecode(np.frombuffer(files[picture], np.uint8), cv2.IMREAD_COLOR)
    assert shown is not None
    assert shown.shape[0] == 640
    assert shown.std() > 5
    page = html.unescape(files["report.html"].decode())
    assert "FAIL" in page
    assert str(health[ill].found) in page
    assert str(health[ill].remedy) in page


@pytest.mark.parametrize(
    ("holder_mm", "names"),
    [
        pytest.param(2.0, {"onset", "area", "rising"}, id="no ball"),
        pytest.param(14.0, {"onset", "area"}, id="another ball"),
        pytest.param(24.0, {"onset"}, id="contact at the start"),
    ],
)
def test_what_is_not_the_ball_in_its_place_fails(drawn_ball, draft, holder_mm, names):
    verification = verified(drawn_ball(1, mm_per_px=0.0285, holder_mm=holder_mm), draft).verification
    assert names <= {check.name for check in verification.checks if not check.passed}


def test_called_off_in_the_middle_the_jaws_open(drawn_ball, draft):
    def called_off(progress):
        if progress.number == 3:
            raise asyncio.CancelledError

    ball = drawn_ball(1, mm_per_px=0.0285)
    with pytest.raises(asyncio.CancelledError):
        verified(ball, draft, called_off)
    assert ball.released == 1


def test_real_sensors_without_contact_are_not_called_torn_or_dirty(real_images):
    pictures = sorted((real_images / "digit_backgrounds").glob("*.jpg"))
    assert len(pictures) >= 20
    for path in pictures:
        small = cv2.imread(str(path))
        assert small is not None
        picture = cv2.resize(small, (480, 640), interpolation=cv2.INTER_CUBIC)
        assert examine(np.asarray(picture, np.uint8), None, 0.75) == [], path.name


def test_a_mark_shows_where_the_dirt_lies(drawn_ball):
    ball = drawn_ball(1)
    golden = median_image(asyncio.run(take_reference(ball, 5)).images)
    ball.condition = Condition(dirt=1)
    [finding] = examine(median_image(asyncio.run(take_reference(ball, 5)).images), golden, 0.75)
    marked = (finding.picture == (0, 0, 255)).all(axis=2)
    now = median_image(asyncio.run(take_reference(ball, 5)).images).astype(float)
    speck = np.abs(now - golden).max(axis=2) > 25
    rows, columns = np.nonzero(marked)
    inside = speck[rows.min() : rows.max(), columns.min() : columns.max()]
    assert inside.sum() > 0.9 * speck.sum() > 50
