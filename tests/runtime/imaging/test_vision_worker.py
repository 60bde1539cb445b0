"""Measurement ahead: what is measured while more frames are captured comes to the same, and nothing is done twice."""

import asyncio
from types import SimpleNamespace

import numpy as np
import pytest

from station.devices.camera.interface import Frame
from station.press.rig import Position, Step
from station.runtime.imaging import worker as module
from station.runtime.imaging.golden_reference import GoldenReference
from station.runtime.imaging.worker import VisionWorker
from station.settings.recipe import find_recipe
from station.settings.service import ReferenceSettings
from station.state_files import StateFiles
from station.vision.methods import make_method
from station.vision.press import PressTracker
from station.vision.step import measure_step

BLUEBERRY = find_recipe("blueberry")


def frame(seed: int, pressed: float = 0.0) -> Frame:
    """A drawn gel, shape (120, 160, 3), with a bump in its middle."""
    y, x = np.mgrid[-60:60, -80:80]
    bump = pressed * np.exp(-(x**2 + y**2) / 400.0)
    slopes = np.dstack([128 + x * bump, 128 + y * bump, 128 - x * bump])
    noise = np.random.default_rng(seed).normal(0, 1, slopes.shape)
    return Frame(np.clip(slopes + noise, 0, 255).astype(np.uint8), seed, float(seed))


def step_of(frames: list[Frame]) -> Step:
    return Step(1, Position(18.0), tuple(frames))


@pytest.fixture
def previous_contacts():
    """The contact of the step before, for each image that was measured, in order; None for a step by itself."""
    return []


@pytest.fixture
def seen_images(monkeypatch, previous_contacts):
    """The images that the worker's method measured, by their identity, in order."""
    seen: list[int] = []

    def counting(reference, segmentation):
        method = make_method(reference, segmentation)

        def measure(image, on_stage=None, previous=None, agreed=1.0, *, firm_only=False):
            seen.append(id(image))
            previous_contacts.append(previous)
            return method.measure(image, on_stage, previous, agreed, firm_only=firm_only)

        return SimpleNamespace(stages=method.stages, measure=measure)

    monkeypatch.setattr(module, "make_method", counting)
    return seen


def test_a_step_whose_frames_were_measured_as_they_came_is_measured_the_same_and_none_twice(tmp_path, seen_images):
    references, frames = [frame(seed) for seed in range(3)], [frame(10 + seed, 2.0) for seed in range(3)]

    async def scenario():
        worker = VisionWorker(GoldenReference(StateFiles(tmp_path)), ReferenceSettings())
        try:
            await worker.take_reference(references, BLUEBERRY.segmentation)
            for each in frames[:2]:
                worker.measure_ahead(each)
            return await worker.measure(step_of(frames))
        finally:
            worker.close()

    seen = asyncio.run(scenario())
    assert seen_images[:3] == [id(each.image) for each in frames]
    assert len(seen_images) == 4  # and their mean
    median = np.median([each.image for each in references], axis=0).astype(np.uint8)
    method = make_method(median, BLUEBERRY.segmentation)
    plain = measure_step(method, [each.image for each in frames])
    assert plain.found
    assert (seen.contact.area_px, seen.contact.confidence) == (plain.area_px, plain.confidence)
    assert (seen.contact.mask == plain.mask).all()


def test_a_frame_that_was_begun_against_an_old_reference_is_measured_anew(tmp_path, seen_images):
    async def scenario():
        worker = VisionWorker(GoldenReference(StateFiles(tmp_path)), ReferenceSettings())
        try:
            await worker.take_reference([frame(1)], BLUEBERRY.segmentation)
            pressed = frame(10, 2.0)
            worker.measure_ahead(pressed)
            await worker.take_reference([frame(2)], BLUEBERRY.segmentation)
            await worker.measure(step_of([pressed]))
            return id(pressed.image)
        finally:
            worker.close()

    image = asyncio.run(scenario())
    assert seen_images == [image, image]


def test_a_press_is_followed_from_its_first_contact_until_the_next_reference(tmp_path, seen_images, previous_contacts):
    steps = [[frame(100 * number + seed, 1.0 + number / 2) for seed in range(2)] for number in range(4)]

    async def scenario():
        worker = VisionWorker(GoldenReference(StateFiles(tmp_path)), ReferenceSettings())
        try:
            await worker.take_reference([frame(seed) for seed in range(3)], BLUEBERRY.segmentation)
            glanced = await worker.measure(step_of(steps[0]))
            first = await worker.measure(step_of(steps[1]))
            await worker.follow(first.contact)
            measuring = asyncio.ensure_future(worker.measure(step_of(steps[2])))
            await asyncio.sleep(0)
            for each in steps[3]:  # captured while the step before is still measured
                worker.measure_ahead(each)
            followed = [first, await measuring, await worker.measure(step_of(steps[3]))]
            await worker.take_reference([frame(seed) for seed in range(3)], BLUEBERRY.segmentation)
            await worker.measure(step_of(steps[0]))
            return glanced, followed
        finally:
            worker.close()

    glanced, followed = asyncio.run(scenario())
    assert glanced.contact.found
    contacts = [seen.contact for seen in followed]
    expected = [None] * 6 + [contacts[0]] * 3 + [contacts[1]] * 3 + [None] * 3
    assert len(previous_contacts) == len(expected), "no frame was measured twice"
    assert all(one is other for one, other in zip(previous_contacts, expected, strict=True))
    median = np.median([frame(seed).image for seed in range(3)], axis=0).astype(np.uint8)
    tracker = PressTracker(make_method(median, BLUEBERRY.segmentation), first=contacts[0])
    again = [tracker.measure_step([each.image for each in frames]) for frames in steps[2:]]
    assert [one.area_px for one in again] == [one.area_px for one in contacts[1:]]
    assert [one.confidence for one in again] == [one.confidence for one in contacts[1:]]
