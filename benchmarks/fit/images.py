"""Images of the fit's data sets that are rendered for it: at the working size, with the truth of each.

All are made of a seed; `parts.py` has the seeds to fit on and those for validation.
"""

from dataclasses import replace
from itertools import product

import cv2
import numpy as np
import numpy.typing as npt
from bench_measurement import noisy
from measurement import on_the_twin
from measurement.at_the_border import PLACES
from measurement.data_sets import PressData
from measurement.light_touch import DETECTION_PLACES, DETECTION_UNITS, light_closings
from measurement.soft_bodies import moved_specks, with_jpeg, with_video
from measurement.untouched import CONDITIONS

from station.twin.contact import MIDDLE_X_PX, MIDDLE_Y_PX, Pose
from station.twin.digit.press import PressOptions
from station.twin.digit.sensor import DigitSensor
from station.twin.fruit import Kind, draw_fruit
from station.vision.contact import FloatImage, Image
from station.vision.step import mean_image
from station.vision.working import working_image

BORDER_CLOSINGS_MM = (1.2, 2.5, 5.0)
LARGE_BALLS_MM, LARGE_CLOSINGS_MM = (26.0, 32.0, 38.0, 44.0), (4.0, 5.5, 7.0)
"""Contact areas of 60 to 150 mm²; the field has 217."""
OFF_CENTRE_PX = 8.0
"""Standard deviation of a ball's place, 0.2 mm."""
AFTER_S = (5.0, 11.0)
"""Since the reference."""
LEAST_QUALITY, MOST_QUALITY = 30, 60
"""JPEG's: files from the web."""


def untouched(backgrounds: list[Image], seed: int, draws: int = 3) -> list[PressData]:
    """Backgrounds of real units, each against itself with noise and drift."""
    found: list[PressData] = []
    for number, background in enumerate(backgrounds):
        generator = np.random.default_rng([seed, number])
        reference = _larger(background) if number % 2 else background
        frames = [working_image(noisy(reference, generator)) for _ in range(draws)]
        found.append(_empty("untouched", [working_image(reference)], frames))
    return found


def compressed(backgrounds: list[Image], seed: int) -> list[PressData]:
    """The same, reference and frames stored as JPEG of low quality, or as one video."""
    found: list[PressData] = []
    for number, background in enumerate(backgrounds):
        generator = np.random.default_rng([seed, number, 1])
        reference = _larger(background) if number % 2 else background
        for _ in range(2):
            quality = int(generator.integers(LEAST_QUALITY, MOST_QUALITY + 1))
            stored = with_jpeg([reference, noisy(reference, generator)], quality)
            found.append(_empty("JPEG", [working_image(stored[0])], [working_image(stored[1])]))
        # Several frames on: by then the codec has passed on what the first key frame left out.
        film = with_video([reference, *(noisy(reference, generator) for _ in range(4))])
        found.append(_empty("video", [working_image(film[0])], [working_image(film[-1])]))
    return found


def shadows(backgrounds: list[Image], seed: int, draws: int = 6) -> list[PressData]:
    """Backgrounds of real units on which a soft shadow falls, or a stain of one colour: neither curves the gel."""
    found: list[PressData] = []
    for number, background in enumerate(backgrounds):
        generator = np.random.default_rng([seed, number, 2])
        reference = _larger(background) if number % 2 else background
        for shaded in (_shadowed, _stained):
            frames = [working_image(noisy(shaded(reference, generator), generator)) for _ in range(draws)]
            found.append(_empty(shaded.__name__.strip("_"), [working_image(reference)], frames))
    return found


def _shadowed(image: Image, generator: np.random.Generator) -> Image:
    """Up to half of all light gone from a spot."""
    return _rounded(image * (1 - generator.uniform(0.1, 0.5) * _spot(image, generator)))


def _stained(image: Image, generator: np.random.Generator) -> Image:
    """A spot of one colour that adds light of it or takes some."""
    colour = generator.normal(size=3)
    return _rounded(image + generator.uniform(10, 60) * _spot(image, generator) * colour / np.linalg.norm(colour))


def _spot(image: Image, generator: np.random.Generator) -> FloatImage:
    """A spot of some size and sharpness, shape (height, width, 1), 1 in its middle and 0 far from it."""
    height, width = image.shape[:2]
    radius_px = generator.uniform(0.08, 0.3) * max(height, width)
    x = (np.arange(width) - generator.uniform(0.2, 0.8) * width) / radius_px
    y = (np.arange(height) - generator.uniform(0.2, 0.8) * height) / (radius_px * generator.uniform(0.6, 1.6))
    away = np.square(x)[None, :] + np.square(y)[:, None]
    return np.exp(-(away ** generator.choice([1, 2, 4]))).astype(np.float32)[..., None]


def _rounded(image: npt.NDArray[np.floating]) -> Image:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def other_units(backgrounds: list[Image]) -> list[PressData]:
    """Untouched frames of one real unit against the reference of the next, of the same size."""
    sizes = {one.shape for one in backgrounds}
    found: list[PressData] = []
    for shape in sorted(sizes):
        own = [one for one in backgrounds if one.shape == shape]
        pairs = zip(own, [*own[1:], own[0]], strict=True) if len(own) > 1 else ()
        found += [_empty("other unit", [working_image(a)], [working_image(b)]) for a, b in pairs]
    return found


def untouched_twin(seed: int, units: int = 24) -> list[PressData]:
    """Untouched units of the twin as they drift away from their reference, in four conditions."""
    found: list[PressData] = []
    for unit in range(seed, seed + units):
        for condition in CONDITIONS:
            options = on_the_twin.conditions()[condition]
            sensor = DigitSensor(unit, unit, options.noise, options.drift)
            references = [
                sensor.frame(None, k / on_the_twin.FRAMES_PER_S, options.condition) for k in range(options.references)
            ]
            frames = [
                [
                    sensor.frame(None, after_s + k / on_the_twin.FRAMES_PER_S, options.condition)
                    for k in range(on_the_twin.FRAMES_PER_STEP)
                ]
                for after_s in AFTER_S
            ]
            found.append(
                _empty(
                    f"untouched, {condition}",
                    [working_image(one) for one in references],
                    [working_image(mean_image(step)) for step in frames],
                )
            )
    return found


def moved_debris(seed: int, pairs: int = 12) -> list[PressData]:
    """Untouched gel of the twin with specks of debris, some of which have moved since the reference."""
    return [
        _empty(
            "moved debris", [working_image(one) for one in pair.references], [working_image(mean_image(pair.frames))]
        )
        for pair in moved_specks(range(seed, seed + pairs))
    ]


def weak_contacts(seed: int) -> list[PressData]:
    """Contacts of about 0.7, 1 and 2 mm² of each fruit at several places on two units."""
    found: list[PressData] = []
    for kind in on_the_twin.FRUITS:
        for number, (x_px, y_px) in enumerate(DETECTION_PLACES):
            options = PressOptions(pose=Pose(x_px, y_px), unit=DETECTION_UNITS[number % 2])
            closings_mm = light_closings(kind, seed + number, options)[:2]
            fruit = draw_fruit(kind, seed + number)
            press = on_the_twin.squeezed_with_masks(fruit, seed + number, options, [0.6 * closings_mm[0], *closings_mm])
            found.append(PressData(f"{kind}, weak", *press))
    return found


def large_balls(seed: int, units: int = 8) -> list[PressData]:
    """Firm balls as large as fruit or larger, each on several units, pressed until they leave little background."""
    found: list[PressData] = []
    for number, (across_mm, unit) in enumerate(product(LARGE_BALLS_MM, range(seed, seed + units))):
        x_px, y_px = np.random.default_rng(seed + number).normal(0.0, OFF_CENTRE_PX, 2)
        ball = replace(draw_fruit(Kind.RUBBER_BALL, 0), width_mm=across_mm, length_mm=across_mm)
        options = PressOptions(pose=Pose(MIDDLE_X_PX + x_px, MIDDLE_Y_PX + y_px), unit=unit)
        press = on_the_twin.squeezed_with_masks(ball, seed + number, options, LARGE_CLOSINGS_MM)
        found.append(PressData(f"ball of {across_mm:g} mm", *press))
    return found


def border(seed: int) -> list[PressData]:
    """Contacts that the border cuts, two fruits at each place of `at_the_border`: the truth is their visible part."""
    found: list[PressData] = []
    for place, middles in PLACES.items():
        for number, (x_px, y_px) in enumerate(middles):
            for kind in on_the_twin.FRUITS[number % 2 :: 2]:
                options = PressOptions(pose=Pose(x_px, y_px), unit=number or None)
                references, images, truths = on_the_twin.squeezed_with_masks(
                    draw_fruit(kind, seed + number), seed + number, options, BORDER_CLOSINGS_MM
                )
                cut = [any(side.any() for side in (t[[0, -1]], t[:, [0, -1]])) for t in truths]
                seen = [k for k, is_cut in enumerate(cut) if is_cut]
                if seen:
                    kept = [images[k] for k in seen], [truths[k] for k in seen]
                    found.append(PressData(f"{kind}, {place}", references, *kept))
    return found


def _empty(group: str, references: list[Image], frames: list[Image]) -> PressData:
    return PressData(group, references, frames, [np.zeros(frame.shape[:2], np.bool_) for frame in frames])


def _larger(image: Image) -> Image:
    """As a camera of 640x480 would give it: its noise is finer than the working size."""
    if max(image.shape) >= 640:
        return image
    return np.asarray(cv2.resize(image, (480, 640), interpolation=cv2.INTER_CUBIC), np.uint8)
