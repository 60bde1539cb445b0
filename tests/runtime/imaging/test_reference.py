"""Faults of a reference: each has the same alarm, however the light has drifted since the golden one."""

import numpy as np
import pytest

from station.inspection.alarm_table import AlarmId
from station.press.reference import BadReferenceError, check_reference
from station.runtime.imaging.golden_reference import GoldenReference
from station.settings.recipe import find_recipe
from station.settings.service import ReferenceSettings
from station.state_files import StateFiles
from station.twin.digit.sensor import Condition, DigitSensor
from station.vision.median import median_image


@pytest.mark.parametrize(
    ("condition", "alarm"),
    [
        (Condition(), None),
        (Condition(dead_led="red"), AlarmId.CAMERA_LED_DEAD),
        (Condition(dead_led="green"), AlarmId.CAMERA_LED_DEAD),
        (Condition(fog=1.0), AlarmId.CAMERA_DIRTY),
        (Condition(dirt=5), AlarmId.REFERENCE_BAD),
    ],
    ids=["sound", "no red", "no green", "fog", "dirt"],
)
def test_each_ill_of_gel_and_light_has_its_alarm_at_any_time(tmp_path, condition, alarm):
    sensor, now_s = DigitSensor(1), 0.0

    def reference(condition=None):
        frames = []
        for _ in range(3):
            frames.append(sensor.frame(None, now_s + len(frames) / 30, condition))
        return median_image(frames)

    golden = GoldenReference(StateFiles(tmp_path))
    golden.store_first(reference())
    for now_s in np.linspace(20.0, 200.0, 8):
        prepared = golden.prepared(find_recipe("blueberry").segmentation)
        assert prepared is not None
        try:
            check_reference(reference(condition), prepared, ReferenceSettings())
            found = None
        except BadReferenceError as error:
            found = error.alarm
        assert found == alarm, f"after {now_s:.0f} s"
