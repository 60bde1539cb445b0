"""A press is one measurement, from the first contact to the record, the judge and the pages."""

import asyncio
import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

from hmi.past.pictures import read_stages
from station.messages.judge import EDGE_LOST
from station.records.database import records_folder
from station.runtime.imaging import worker as vision_worker
from station.vision.methods import make_method
from station.vocabulary import Flag, Reason
from tests.stored_inspection import read_record


@pytest.fixture
def measurements(monkeypatch):
    """Record for each image the contact of the step before, which the method was given, and its own, which it gave.

    The changed area is given as twice the area, and with `lost` set every contact's edge counts as lost.
    """
    made = SimpleNamespace(pairs=[], lost=False)

    def recording(reference, segmentation):
        method = make_method(reference, segmentation)

        def measure(image, on_stage=None, previous=None, agreed=1.0, *, firm_only=False):
            found = method.measure(image, on_stage, previous, agreed, firm_only=firm_only)
            flags = found.flags | ({Flag.LOWER_BOUND} if made.lost and found.found else set())
            contact = replace(found, flags=flags, changed_area_px=2 * found.area_px)
            made.pairs.append((previous, contact))
            return contact

        return SimpleNamespace(stages=method.stages, measure=measure)

    monkeypatch.setattr(vision_worker, "make_method", recording)
    return made


@pytest.fixture
def inspect(bench, settings_file):
    """Inspect a sound blueberry, keep its images, and give the outcome with its record."""
    file = settings_file()
    values = json.loads(file.read_text())
    values["records"]["accepted_share"] = 1.0
    file.write_text(json.dumps(values))

    def run():
        async def scenario():
            async with bench(file) as cell:
                await cell.choose("blueberry")
                outcome = await cell.line.inspect()
                records = cell.station.service.registry.records
                async with asyncio.timeout(60):
                    while records.status().images_waiting:
                        await asyncio.sleep(0.05)
                return outcome, read_record(records, outcome.sequence)

        return asyncio.run(scenario())

    return run


def test_each_step_is_measured_with_the_contact_of_the_step_before(inspect, measurements, tmp_path):
    outcome, record = inspect()
    assert outcome.outcome == "PASS", record.judged.explanation
    curve = record.judged.curve
    before = [previous for previous, _ in measurements.pairs if previous is not None]
    in_turn = list({id(previous): previous.area_px for previous in before}.values())
    assert in_turn[: len(curve) - 1] == [point.area_px for point in curve[:-1]]
    assert len(in_turn) <= len(curve), "at most one more: frames of a step that an early stop ended"
    first = next(number for number, (previous, _) in enumerate(measurements.pairs) if previous is not None)
    assert all(previous is not None for previous, _ in measurements.pairs[first:]), "nothing ends the press"
    assert any(not contact.found for _, contact in measurements.pairs[:first]), "the approach, each step by itself"
    for point in curve:
        assert point.changed_area_px == 2 * point.area_px
        assert point.changed_area_mm2 == pytest.approx(2 * point.area_mm2)


def test_the_stages_of_a_stored_step_are_those_of_its_press(inspect, tmp_path):
    _, record = inspect()
    folder = records_folder(tmp_path / "home")
    again = [read_stages(folder, 1, point.step).area_px for point in record.judged.curve]
    assert again == [point.area_px for point in record.judged.curve]


def test_a_sound_fruit_whose_edge_was_lost_does_not_pass(inspect, measurements):
    measurements.lost = True
    outcome, record = inspect()
    assert outcome.outcome == "NO_RESULT"
    assert Reason.LOW_CONFIDENCE in outcome.reasons
    assert {flag for point in record.judged.curve for flag in point.flags} >= {"lower_bound"}
    assert EDGE_LOST.id in [message.id for message in record.judged.explanation]
